"""Single pictures of hands with their truth: any hand, any pose, any light.

Clips (:mod:`synth.clip`) are for measuring, few and slow; these are for learning from, many and
small. Hands are blends of the shipped ones with their own lengths and girths; fingers are on the
lines between states, as in the shipped recording, or bent joint by joint; the palm or the back
is shown, tilted; lamps stand anywhere. The middle of the picture is near the middle of the hand.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handtrack.camera import Camera
from handtrack.hand.skeleton import LIMITS
from synth.fingers import recorded, some_state
from synth.handspec import HAND_NAMES, HandSpec
from synth.kinematics import keypoints_mm
from synth.light import shade
from synth.paint import paint
from synth.render import Renderer
from synth.scene import Light
from synth.skin import Skin
from synth.surface import rest_mesh
from synth.tones import TONES

Array = NDArray[np.float64]

#: Side of a picture, and length of the palm in it when it is seen from ahead.
SIDE_PX, PALM_PX = 144, 40.0
#: Pictures of one hand, and of one focal length among them.
OF_A_HAND, OF_A_LENS = 60, 10
_VOXEL_MM = 3.0
_AT_MM = (0.0, 0.0, 450.0)
_BRIGHTNESS = np.array([0.3, 0.59, 0.11])
#: How much of the spread of the fingers each finger takes.
_SPREAD = np.array([0.0, 1.0, 0.3, -0.4, -1.0])


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


def pictures(rng: np.random.Generator) -> Iterator[Picture]:
    """Pictures without end.

    Raises
    ------
    NoGLError
        There is no OpenGL without a display.
    """
    while True:
        hand = random_hand(rng)
        arm_mm = float(rng.choice([25.0, 40.0, 80.0, 160.0, 220.0]))
        skin = Skin(rest_mesh(hand, arm_mm, _VOXEL_MM), hand)
        albedo = paint(skin, str(rng.choice(list(TONES))), rng)
        palm_mm = float(np.linalg.norm(hand.base_mm[2]))
        for _ in range(OF_A_HAND // OF_A_LENS):
            distance = rng.uniform(280, 900)
            focal = PALM_PX * distance / palm_mm
            middle = (SIDE_PX - 1) / 2
            camera = Camera(focal, focal, middle, middle, SIDE_PX, SIDE_PX)
            with Renderer(camera) as renderer:
                for _ in range(OF_A_LENS):
                    picture = _picture(skin, albedo, renderer, camera, distance, rng)
                    if picture is not None:
                        yield picture


def _picture(
    skin: Skin,
    albedo: Array,
    renderer: Renderer,
    camera: Camera,
    distance_mm: float,
    rng: np.random.Generator,
) -> Picture | None:
    """One picture, or None where an arm reaches behind the camera."""
    theta, R = random_angles(rng), random_rotation(rng)
    half_palm = np.array([0.0, 0.5 * np.linalg.norm(skin.hand.base_mm[2]), 0.0])
    palm = R @ half_palm
    points = keypoints_mm(theta[None], skin.hand)[0] @ R.T
    middle = 0.5 * palm + 0.25 * (points.min(axis=0) + points.max(axis=0))
    offset = rng.normal(0, 4.0, 2)
    t_mm = np.array([offset[0] - middle[0], offset[1] - middle[1], distance_mm - palm[2]])
    wrist = rng.normal(0, np.radians(12), 2)
    v = skin.pose(theta, (float(wrist[0]), float(wrist[1])))
    seen = v @ R.T + t_mm
    if seen[:, 2].min() < 60:
        return None
    lights, ambient = random_light(rng)
    faces = skin.mesh.faces
    colours = shade(seen, skin.normals(v) @ R.T, faces, albedo, lights, ambient)
    rgba = renderer.draw(seen, faces, colours)
    grey = (rgba[..., :3] @ _BRIGHTNESS).astype(np.uint8)
    at_px = camera.project((palm + t_mm)[None])[0]
    return Picture(grey, rgba[..., 3], theta, R, at_px, camera.fx_px)


def random_hand(rng: np.random.Generator) -> HandSpec:
    """A blend of two of the shipped hands, with lengths, girths and a thumb of its own."""
    one, other = (HandSpec.named(str(name)) for name in rng.choice(HAND_NAMES, 2))
    w = rng.random()
    v: dict[str, Any] = {
        f.name: (1 - w) * np.asarray(getattr(one, f.name)) + w * np.asarray(getattr(other, f.name))
        for f in fields(HandSpec)
    }
    v["length_mm"] *= np.exp(rng.normal(0, 0.05, (5, 1)) + rng.normal(0, 0.03, (5, 3)))
    v["radius_mm"] *= np.exp(rng.normal(0, 0.08) + rng.normal(0, 0.04, (5, 1)))
    v["fan_deg"] += rng.normal(0, [5.4, 2, 2, 2, 2])
    v["roll_deg"] += rng.normal(0, [8, 0, 0, 0, 0])
    for name, spread in (
        ("thenar_mm", 0.07), ("hypothenar_mm", 0.07), ("web", 0.07),
        ("palm_thickness_mm", 0.08), ("wrist_mm", 0.07), ("forearm_mm", 0.1),
    ):  # fmt: skip
        v[name] = v[name] * np.exp(rng.normal(0, spread))
    for name in ("thenar_mm", "hypothenar_mm", "web"):
        v[name] = float(v[name])
    return HandSpec(**v)


def random_angles(rng: np.random.Generator) -> Array:
    """Angles ``(20,)``, radians: between states, as recorded, or bent joint by joint."""
    kind = rng.random()
    if kind < 0.35:
        s = rng.random() if rng.random() < 0.7 else 0.0
        theta = (1 - s) * some_state(rng) + s * some_state(rng)
    elif kind < 0.5:
        motion = recorded("")
        theta = motion[rng.integers(len(motion))] + np.radians(rng.normal(0, 5, 20))
    else:
        theta = np.radians(_joint_by_joint(rng)).ravel()
    return np.clip(theta, *LIMITS.T)


def _joint_by_joint(rng: np.random.Generator) -> Array:
    """Angles ``(5, 4)`` in degrees; in half of the hands the fingers have much in common."""
    deg = np.zeros((5, 4))
    deg[0] = rng.uniform((-12, -8, -8, -12), (42, 36, 52, 62))
    common, alike = rng.random(3), rng.random() < 0.5
    for finger in range(1, 5):
        own = rng.random(3)
        x = np.where(rng.random(3) < 0.5, common, own) if alike else own
        mcp, pip = -12 + 102 * x[0], 110 * x[1]
        dip = pip * (0.25 + 0.75 * x[2]) + rng.normal(0, 6)
        if rng.random() < 0.15:
            dip = rng.uniform(0, 20)
        deg[finger] = mcp, rng.normal(0, 7) * (1 - 0.7 * max(mcp, 0.0) / 90), pip, dip
    deg[:, 1] += _SPREAD * rng.normal(3, 5)
    return deg


def random_rotation(rng: np.random.Generator) -> Array:
    """Palm to camera ``(3, 3)``: the palm or the back, fingers up, tilted and rolled."""
    side = np.diag([1.0, -1.0, -1.0] if rng.random() < 0.6 else [-1.0, -1.0, 1.0])
    tilt = 25.0 if rng.random() < 0.75 else 50.0
    turn = np.radians([*rng.normal(0, tilt, 2), rng.normal(0, 25)])
    return np.asarray(Rotation.from_rotvec(turn).as_matrix() @ side)


def random_light(rng: np.random.Generator) -> tuple[tuple[Light, ...], float]:
    """A sun and up to two bulbs, mostly from above, and the light from everywhere."""
    lights = []
    for k in range(rng.integers(1, 4)):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        way[2] = -abs(way[2])
        if rng.random() < 0.7:
            way[1] = -abs(way[1])
        x, y, z = 500 * way + _AT_MM
        strength = float(rng.uniform(0.05, 0.4) if k else rng.uniform(0.2, 0.9))
        lights.append(Light("point" if k else "sun", (x, y, z), _AT_MM, strength))
    return tuple(lights), float(rng.uniform(0.15, 0.6))
