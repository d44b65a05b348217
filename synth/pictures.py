"""Single pictures of hands with their truth, to learn from.

Clips (:mod:`synth.clip`) are for measuring, few and slow; these are many and small, of any hand in
any pose and light (:mod:`synth.draws`), some of cardboard. The middle of the picture is near the
middle of the hand.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from synth.cardboard import Patch, painted, patches
from synth.draws import random_angles, random_hand, random_rotation
from synth.handspec import HandSpec
from synth.kinematics import Bending
from synth.light import random_light, shade
from synth.paint import paint
from synth.render import Renderer
from synth.skin import Skin
from synth.surface import rest_mesh
from synth.tones import TONES

Array = NDArray[np.float64]

#: Side of a picture, and length of the palm in it when it is seen from ahead.
SIDE_PX, PALM_PX = 144, 40.0
#: Pictures of one hand, and of one focal length among them.
OF_A_HAND, OF_A_LENS = 60, 10
#: Share of the hands that are of cardboard.
CARDBOARD = 0.1
_VOXEL_MM, _NEAREST_MM = 3.0, 60.0
#: Of red, green and blue in brightness.
BRIGHTNESS = np.array([0.3, 0.59, 0.11])


@dataclass(frozen=True, eq=False)
class Picture:
    """A right hand before nothing.

    Attributes
    ----------
    grey, alpha : (SIDE_PX, SIDE_PX) uint8
        Brightness, premultiplied, and how much of a pixel is hand.
    theta : (20,)
        Joint angles, radians.
    R : (3, 3)
        Palm to camera.
    at_px : (2,)
        Where the middle of the palm's axis lies.
    focal_px : float
        The camera's, its principal point in the middle of the picture.
    """

    grey: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    theta: Array
    R: Array
    at_px: Array
    focal_px: float


class Model(Protocol):
    """A right hand that pictures are made of."""

    @property
    def palm_mm(self) -> float:
        """Length of its palm."""
        ...

    def bent(self, theta: Array) -> tuple[Array, Array]:
        """Its keypoints ``(21, 3)``, mm, in the palm's frame, and its angles ``(20,)``.

        They are about ``theta``, if it does not bend just as ours do.
        """
        ...

    def draw(
        self,
        theta: Array,
        R: Array,
        t_mm: Array,
        wrist: Array,
        renderer: Renderer,
        rng: np.random.Generator,
    ) -> NDArray[np.uint8] | None:
        """RGBA, or None where an arm reaches behind the camera."""
        ...


class _Ours(Bending):
    """A hand as :mod:`synth.kinematics` bends it."""

    def __init__(self, hand: HandSpec) -> None:
        super().__init__(hand)
        self.palm_mm = float(np.linalg.norm(hand.base_mm[2]))


class _Skinned(_Ours):
    """A hand of skin."""

    def __init__(self, hand: HandSpec, arm_mm: float, tone: str, rng: np.random.Generator) -> None:
        super().__init__(hand)
        self.skin = Skin(rest_mesh(hand, arm_mm, _VOXEL_MM), hand)
        self.albedo = paint(self.skin, tone, rng)

    def draw(
        self,
        theta: Array,
        R: Array,
        t_mm: Array,
        wrist: Array,
        renderer: Renderer,
        rng: np.random.Generator,
    ) -> NDArray[np.uint8] | None:
        """As :meth:`Model.draw`."""
        v = self.skin.pose(theta, (float(wrist[0]), float(wrist[1])))
        seen = v @ R.T + t_mm
        return lit(
            seen, self.skin.normals(v) @ R.T, self.skin.mesh.faces, self.albedo, renderer, rng
        )


class _Cardboard(_Ours):
    """A hand of cardboard."""

    def __init__(self, hand: HandSpec, arm_mm: float, tone: str) -> None:
        super().__init__(hand)
        self.arm_mm, self.tone = arm_mm, np.array(TONES[tone], float)

    def draw(
        self,
        theta: Array,
        R: Array,
        t_mm: Array,
        wrist: Array,
        renderer: Renderer,
        rng: np.random.Generator,
    ) -> NDArray[np.uint8] | None:
        """As :meth:`Model.draw`."""
        pieces = patches(theta, self.hand, self.arm_mm, wrist)
        seen = [Patch(p.corners @ R.T + t_mm, p.shade) for p in pieces]
        if min(p.corners[:, 2].min() for p in seen) < _NEAREST_MM:
            return None
        return painted(seen, self.tone, renderer.camera)


def lit(
    seen_mm: Array,
    normals: Array,
    faces: NDArray[np.int32],
    albedo: Array,
    renderer: Renderer,
    rng: np.random.Generator,
) -> NDArray[np.uint8] | None:
    """RGBA of a mesh in the camera's frame under some lamps, or None where it is too near."""
    if seen_mm[:, 2].min() < _NEAREST_MM:
        return None
    lights, ambient = random_light(rng)
    return renderer.draw(seen_mm, faces, shade(seen_mm, normals, faces, albedo, lights, ambient))


def pictures(rng: np.random.Generator) -> Iterator[Picture]:
    """Pictures without end.

    Raises
    ------
    NoGLError
        There is no OpenGL without a display.
    """
    while True:
        hand, tone = random_hand(rng), str(rng.choice(list(TONES)))
        arm_mm = float(rng.choice([25.0, 40.0, 80.0, 160.0, 220.0]))
        of_cardboard = rng.random() < CARDBOARD
        model = (
            _Cardboard(hand, arm_mm, tone) if of_cardboard else _Skinned(hand, arm_mm, tone, rng)
        )
        yield from pictures_of(model, rng)


def pictures_of(model: Model, rng: np.random.Generator) -> Iterator[Picture]:
    """Some pictures of one hand, through several lenses."""
    for _ in range(OF_A_HAND // OF_A_LENS):
        distance = rng.uniform(280, 900)
        focal = PALM_PX * distance / model.palm_mm
        middle = (SIDE_PX - 1) / 2
        with Renderer(Camera(focal, focal, middle, middle, SIDE_PX, SIDE_PX)) as renderer:
            for _ in range(OF_A_LENS):
                picture = _picture(model, renderer, distance, rng)
                if picture is not None:
                    yield picture


def _picture(
    model: Model, renderer: Renderer, distance_mm: float, rng: np.random.Generator
) -> Picture | None:
    """One picture, or None where an arm reaches behind the camera."""
    theta, R, camera = random_angles(rng), random_rotation(rng), renderer.camera
    palm = R @ np.array([0.0, 0.5 * model.palm_mm, 0.0])
    keypoints, angles = model.bent(theta)
    points = keypoints @ R.T
    middle = 0.5 * palm + 0.25 * (points.min(axis=0) + points.max(axis=0))
    offset = rng.normal(0, 4.0, 2)
    t_mm = np.array([offset[0] - middle[0], offset[1] - middle[1], distance_mm - palm[2]])
    wrist = rng.normal(0, np.radians(12), 2)
    rgba = model.draw(theta, R, t_mm, wrist, renderer, rng)
    if rgba is None:
        return None
    grey = (rgba[..., :3] @ BRIGHTNESS).astype(np.uint8)
    at_px = camera.project((palm + t_mm)[None])[0]
    return Picture(grey, rgba[..., 3], angles, R, at_px, camera.fx_px)
