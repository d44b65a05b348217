"""Pictures of MakeHuman's people: hands with their truth, and portraits without any hand."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.bench.training.grounds import some_colour, texture
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from synth import complexion
from synth.arm import Arm, angles_of
from synth.light import random_light, shade
from synth.makehuman import Body, some_arm, some_body
from synth.pictures import Picture, lit, pictures_of
from synth.render import Renderer
from synth.tones import linear

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

#: Side of a portrait, and focal length of its camera, in pixels.
PORTRAIT_PX, _PORTRAIT_FOCAL_PX = 256, 300.0
_PORTRAITS_OF_ONE = 3
#: Where arms are cut off, mm below the wrist.
_ARMS_MM = (25.0, 40.0, 80.0, 160.0, 260.0)


class _Model:
    """An arm as :class:`synth.pictures.Model`, cut off somewhere."""

    palm_mm = HandShape.default().palm_length_mm

    def __init__(self, arm: Arm, arm_mm: float, albedo: Array) -> None:
        self.arm, self.albedo = arm, albedo
        mesh = arm.mesh
        self.shown = mesh.faces[(mesh.vertices[mesh.faces][:, :, 1] > -arm_mm).all(axis=1)]

    def bent(self, theta: Array) -> tuple[Array, Array]:
        """As :meth:`synth.pictures.Model.bent`."""
        _, joints = self.arm.posed(theta, np.zeros(2))
        return np.vstack([np.zeros(3), joints.reshape(-1, 3)]), angles_of(joints)

    def draw(
        self,
        theta: Array,
        R: Array,
        t_mm: Array,
        wrist: Array,
        renderer: Renderer,
        rng: np.random.Generator,
    ) -> Pixels | None:
        """As :meth:`synth.pictures.Model.draw`."""
        v, _ = self.arm.posed(theta, wrist)
        normals = self.arm.mesh.normals(v) @ R.T
        return lit(v @ R.T + t_mm, normals, self.shown, self.albedo, renderer, rng)


def pictures(folder: Path, rng: np.random.Generator) -> Iterator[Picture]:
    """Pictures of right hands without end, as :func:`synth.pictures.pictures` gives them.

    Raises
    ------
    InputError
        The folder is not MakeHuman's data.
    NoGLError
        There is no OpenGL without a display.
    """
    while True:
        arm = some_arm(folder, rng)
        arm_mm = float(rng.choice(_ARMS_MM))
        albedo = complexion.of_arm(arm, complexion.some_tone(rng), rng)
        yield from pictures_of(_Model(arm, arm_mm, albedo), rng)


def portraits(folder: Path, rng: np.random.Generator) -> Iterator[Pixels]:
    """Portraits ``(PORTRAIT_PX, PORTRAIT_PX, 3)`` without end, of people whose arms end early.

    Raises
    ------
    InputError
        The folder is not MakeHuman's data.
    """
    middle = (PORTRAIT_PX - 1) / 2
    f = _PORTRAIT_FOCAL_PX
    with Renderer(Camera(f, f, middle, middle, PORTRAIT_PX, PORTRAIT_PX)) as renderer:
        while True:
            body = some_body(folder, rng)
            tone, cloth = complexion.some_tone(rng), linear(some_colour(rng))
            albedo = complexion.of_body(body, tone, cloth, rng)
            for _ in range(_PORTRAITS_OF_ONE):
                yield _portrait(body, albedo, renderer, rng)


def _portrait(body: Body, albedo: Array, renderer: Renderer, rng: np.random.Generator) -> Pixels:
    turn = cv2.Rodrigues(np.radians(rng.normal(0, (6, 22, 4))))[0]
    t_mm = np.array([*rng.normal(0, (70, 60)), rng.uniform(400, 1000)])
    # nothing far below the picture needs to be drawn
    v = body.mesh.vertices
    near = (v[body.mesh.faces][:, :, 1] < 900).all(axis=1)
    seen = v @ turn.T + t_mm
    normals = body.mesh.normals(v) @ turn.T
    faces = np.ascontiguousarray(body.mesh.faces[near])
    lights, ambient = random_light(rng)
    rgba = renderer.draw(seen, faces, shade(seen, normals, faces, albedo, lights, ambient))
    behind = cv2.resize(texture(rng), (PORTRAIT_PX, PORTRAIT_PX))
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return np.clip(rgba[..., :3] + behind * (1 - alpha), 0, 255).astype(np.uint8)
