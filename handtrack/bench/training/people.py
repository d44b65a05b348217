"""Pictures of MakeHuman's people: hands with their truth, and portraits without any hand."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.bench.training.grounds import some_colour, texture
from handtrack.bench.training.makehuman import (
    FIRST_DIGIT,
    Arm,
    Body,
    angles_of,
    some_arm,
    some_body,
)
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from synth.draws import random_light
from synth.light import shade
from synth.pictures import Picture, lit, pictures_of
from synth.render import Renderer
from synth.tones import TONES, linear

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

#: Side of a portrait, and focal length of its camera, in pixels.
PORTRAIT_PX, _PORTRAIT_FOCAL_PX = 256, 300.0
_PORTRAITS_OF_ONE = 3
#: Where arms are cut off, mm below the wrist.
_ARMS_MM = (25.0, 40.0, 80.0, 160.0, 260.0)
#: Share of the people whose cloth has about their skin's colour.
_NUDE = 0.12
#: How a redder spot dims red, green and blue, and where in a face there are such spots: mouth, nose
#: and cheeks, mm from between the eyes, and how large.
_RED = np.array([0.2, 1.0, 1.0])
_REDDER = ((0, 65, -60, 22), (0, 25, -75, 18), (40, 30, -40, 25), (-40, 30, -40, 25))


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
        yield from pictures_of(_Model(arm, arm_mm, _skin_of(arm, rng)), rng)


def _skin_of(arm: Arm, rng: np.random.Generator) -> Array:
    """Linear colours ``(n, 4)``: paler in the palm, redder at the joints and the tips, nails."""
    v, joints = arm.mesh.vertices, arm.joints_mm
    palmar = arm.mesh.normals(arm.mesh.vertices)[:, 2]
    tone = _some_tone(rng)
    colour = tone * (1 + rng.uniform(0, 0.25) * palmar[:, None])
    colour *= 1 + rng.normal(0, 0.03, (len(v), 1))
    bends = joints[:, 1:].reshape(-1, 3)
    near = np.linalg.norm(v[:, None] - bends, axis=2).min(axis=1)
    colour *= 1 - rng.uniform(0, 0.25) * np.exp(-((near / 9) ** 2))[:, None] * _RED
    for d in range(5):
        last = arm.weights[:, FIRST_DIGIT + 3 * d + 2] > 0.9
        along = (v - joints[d, 2]) @ (joints[d, 3] - joints[d, 2])
        nail = last & (palmar < -0.4) & (along > 0.45 * np.sum((joints[d, 3] - joints[d, 2]) ** 2))
        colour[nail] = 0.7 * colour[nail] + 0.3 * linear(np.array([240.0, 200.0, 192.0]))
    return _opaque(colour)


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
            albedo = _colours_of(body, rng)
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


def _colours_of(body: Body, rng: np.random.Generator) -> Array:
    """Linear colours ``(n, 4)`` of skin, hair, eyes and cloth, now and then of skin's colour."""
    v = body.mesh.vertices
    tone = _some_tone(rng)
    colour = np.tile(tone, (len(v), 1)) * (1 + rng.normal(0, 0.03, (len(v), 1)))
    for x, y, z, size in _REDDER:
        near = np.exp(-((np.linalg.norm(v - (x, y, z), axis=1) / size) ** 2))
        colour *= 1 - rng.uniform(0, 0.35) * near[:, None] * _RED
    nude = rng.random() < _NUDE
    cloth = tone * rng.uniform(0.6, 1.3) if nude else linear(some_colour(rng))
    stripes = np.sin(v[:, 1] * rng.uniform(0.05, 0.4)) > rng.uniform(-1, 2)
    woven = cloth * (1 - rng.uniform(0, 0.5) * stripes[:, None])
    colour[body.clothed] = woven[body.clothed]
    colour[body.hair] = rng.uniform(0.005, 0.2) * np.array([1.0, rng.uniform(0.6, 1), 0.5])
    colour[body.eyes] = 0.6
    iris = body.eyes & (v[:, 2] < np.quantile(v[body.eyes, 2], 0.2))
    colour[iris] = rng.uniform(0.01, 0.1)
    return _opaque(colour)


def _some_tone(rng: np.random.Generator) -> Array:
    """Linear reflectance ``(3,)`` of somebody's skin."""
    one, other = (np.array(TONES[str(name)], float) for name in rng.choice(list(TONES), 2))
    w = rng.random()
    return linear((w * one + (1 - w) * other) * np.exp(rng.normal(0, 0.05, 3)))


def _opaque(colour: Array) -> Array:
    return np.column_stack([np.clip(colour, 0, 1), np.ones(len(colour))])
