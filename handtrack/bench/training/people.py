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
    Mesh,
    angles_of,
    some_arm,
    some_body,
)
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from synth.draws import random_angles, random_light, random_rotation
from synth.light import shade
from synth.pictures import BRIGHTNESS, OF_A_HAND, OF_A_LENS, PALM_PX, SIDE_PX, Picture
from synth.render import Renderer
from synth.tones import TONES

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

#: Side of a portrait, and focal length of its camera, in pixels.
PORTRAIT_PX, _PORTRAIT_FOCAL_PX = 256, 300.0
_PORTRAITS_OF_ONE = 3
_NEAREST_MM = 60.0
#: Where arms are cut off, mm below the wrist.
_ARMS_MM = (25.0, 40.0, 80.0, 160.0, 260.0)
#: Share of the people whose cloth has about their skin's colour.
_NUDE = 0.12
#: How a redder spot dims red, green and blue, and where in a face there are such spots: mouth, nose
#: and cheeks, mm from between the eyes, and how large.
_RED = np.array([0.2, 1.0, 1.0])
_REDDER = ((0, 65, -60, 22), (0, 25, -75, 18), (40, 30, -40, 25), (-40, 30, -40, 25))


def pictures(folder: Path, rng: np.random.Generator) -> Iterator[Picture]:
    """Pictures of right hands without end, as :func:`synth.pictures.pictures` gives them.

    Raises
    ------
    InputError
        The folder is not MakeHuman's data.
    NoGLError
        There is no OpenGL without a display.
    """
    palm_mm = HandShape.default().palm_length_mm
    middle = (SIDE_PX - 1) / 2
    while True:
        arm = some_arm(folder, rng)
        arm_mm = float(rng.choice(_ARMS_MM))
        mesh, albedo = arm.mesh, _skin_of(arm, rng)
        shown = (mesh.vertices[mesh.faces][:, :, 1] > -arm_mm).all(axis=1)
        cut = Mesh(mesh.vertices, mesh.faces[shown])
        for _ in range(OF_A_HAND // OF_A_LENS):
            distance = rng.uniform(280, 900)
            focal = PALM_PX * distance / palm_mm
            camera = Camera(focal, focal, middle, middle, SIDE_PX, SIDE_PX)
            with Renderer(camera) as renderer:
                for _ in range(OF_A_LENS):
                    picture = _picture(arm, cut, albedo, renderer, distance, rng)
                    if picture is not None:
                        yield picture


def _picture(
    arm: Arm,
    mesh: Mesh,
    albedo: Array,
    renderer: Renderer,
    distance_mm: float,
    rng: np.random.Generator,
) -> Picture | None:
    """One picture, or None where the arm reaches behind the camera."""
    R, wrist = random_rotation(rng), rng.normal(0, np.radians(12), 2)
    v, joints = arm.posed(random_angles(rng), wrist)
    palm = R @ np.array([0.0, 0.5 * HandShape.default().palm_length_mm, 0.0])
    points = np.vstack([np.zeros(3), joints.reshape(-1, 3)]) @ R.T
    middle = 0.5 * palm + 0.25 * (points.min(axis=0) + points.max(axis=0))
    offset = rng.normal(0, 4.0, 2)
    t_mm = np.array([offset[0] - middle[0], offset[1] - middle[1], distance_mm - palm[2]])
    seen = v @ R.T + t_mm
    if seen[:, 2].min() < _NEAREST_MM:
        return None
    lights, ambient = random_light(rng)
    colours = shade(seen, mesh.normals(v) @ R.T, mesh.faces, albedo, lights, ambient)
    rgba = renderer.draw(seen, mesh.faces, colours)
    grey = (rgba[..., :3] @ BRIGHTNESS).astype(np.uint8)
    at_px = renderer.camera.project((palm + t_mm)[None])[0]
    return Picture(grey, rgba[..., 3], angles_of(joints), R, at_px, renderer.camera.fx_px)


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
        colour[nail] = 0.7 * colour[nail] + 0.3 * _linear(np.array([240.0, 200.0, 192.0]))
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
    cloth = tone * rng.uniform(0.6, 1.3) if nude else _linear(some_colour(rng))
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
    return _linear((w * one + (1 - w) * other) * np.exp(rng.normal(0, 0.05, 3)))


def _linear(srgb: Array) -> Array:
    return np.asarray((np.clip(srgb, 0, 255) / 255) ** 2.2)


def _opaque(colour: Array) -> Array:
    return np.column_stack([np.clip(colour, 0, 1), np.ones(len(colour))])
