"""Colour of the skin, vertex by vertex: tone, redness, creases, nails, and a sleeve.

Everything is a smooth function of the chart (`synth.skin.Chart`), so the same spot keeps its
colour however the hand moves.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from synth import quaternion as quat
from synth.kinematics import bone_frames
from synth.skin import Skin
from synth.surface import REST_THETA, Mesh
from synth.tones import TONES, linear

Array = NDArray[np.float64]

#: Creases of the palm as polylines in x, y, as shares of the palm's length.
_PALM_CREASES = (
    [(0.36, 0.72), (0.2, 0.62), (0.08, 0.42), (0.06, 0.2)],
    [(0.36, 0.72), (0.1, 0.66), (-0.2, 0.52), (-0.42, 0.4)],
    [(0.12, 0.92), (-0.05, 0.78), (-0.25, 0.7), (-0.46, 0.68)],
)


def paint(skin: Skin, tone: str, rng: np.random.Generator) -> Array:
    """RGBA in 0..1 ``(n, 4)``, linear light, for every vertex of the rest mesh."""
    if tone not in TONES:
        raise InputError(f"no skin tone '{tone}'; there are {', '.join(TONES)}")
    vertices = skin.mesh.vertices
    normals = skin.normals(vertices)
    colour = np.tile(linear(np.array(TONES[tone], float)), (len(vertices), 1))
    palmar = _palmar(skin, normals)
    warm = np.array([1.06, 0.94, 0.93])
    cool = np.array([0.93, 0.95, 0.97])
    blend = 0.5 + 0.5 * palmar[:, None]
    colour *= warm * blend + cool * (1 - blend)  # the palm is redder, the back duller
    colour *= 1.0 + _mottle(vertices, rng)[:, None] * np.array([0.03, 0.05, 0.05])
    colour *= _redness(skin)
    colour *= (1.0 - _creases(skin, palmar))[:, None] ** np.array([0.8, 1.0, 1.05])
    nail = _nails(skin, palmar)[:, None]
    pink = 0.78 * colour + 0.22 * linear(np.array([240.0, 200.0, 192.0]))
    colour = colour * (1 - nail) + pink * nail
    return np.concatenate([colour.clip(0, 1), np.ones((len(colour), 1))], axis=1)


def dress(albedo: Array, mesh: Mesh, cuff_mm: float, cloth: Array) -> tuple[Array, Array]:
    """Put a striped sleeve of sRGB ``cloth`` ``(3,)`` on, from ``cuff_mm`` below the wrist.

    Returns
    -------
    albedo : (n, 4)
    is_skin : (n, 4)
        White where skin is bare, black where it is not.
    """
    y = mesh.vertices[:, 1]
    below = y < -cuff_mm
    stripe = 1.0 - 0.25 * (np.sin(y * 0.8) > 0.6)
    dressed, is_skin = albedo.copy(), np.ones_like(albedo)
    dressed[below, :3] = (linear(cloth) * stripe[:, None])[below]
    is_skin[below, :3] = 0.0
    return dressed, is_skin


def _palmar(skin: Skin, normals: Array) -> Array:
    """How much a vertex faces the way its own bone's palm side does, -1 to 1."""
    q, _, _ = bone_frames(REST_THETA, skin.hand)
    out = np.concatenate([[[0, 0, 1.0]], quat.rotate(q, np.array([0, 0, 1.0])), [[0, 0, 1.0]]])
    return np.sum(normals * (skin.weights @ out), axis=1)


def _mottle(vertices: Array, rng: np.random.Generator) -> Array:
    """Blotches: a few random waves of 8 to 40 mm."""
    total = np.zeros(len(vertices))
    for _ in range(24):
        direction = rng.normal(size=3)
        direction *= 2 * np.pi / rng.uniform(8, 40) / np.linalg.norm(direction)
        total += np.sin(vertices @ direction + rng.uniform(0, 2 * np.pi))
    return total / np.sqrt(12)


def _redness(skin: Skin) -> Array:
    """Fingertips and knuckles are redder: factors ``(n, 3)``."""
    amount = np.zeros(len(skin.mesh.vertices))
    for d in range(5):
        y = skin.chart.local[:, d, 1]
        ends = np.cumsum(skin.hand.length_mm[d])
        near = 0.9 * np.exp(-(((y - ends[2]) / 9.0) ** 2))
        near += sum(0.4 * np.exp(-(((y - e) / 6.0) ** 2)) for e in ends[:2])
        amount += skin.chart.share[:, d + 1] * near
    return 1.0 - amount[:, None] * np.array([0.0, 0.14, 0.12])


def _creases(skin: Skin, palmar: Array) -> Array:
    """Darkening 0..1 where the skin folds."""
    dark = np.zeros(len(palmar))
    front = np.clip(palmar, 0, 1)
    for d in range(5):
        y = skin.chart.local[:, d, 1]
        ends = np.cumsum(skin.hand.length_mm[d])
        root = skin.hand.web * ends[0] if d else 0.9 * ends[0]
        for at, depth in ((root, 0.22), (ends[0], 0.25), (ends[1], 0.25)):
            fold = depth * np.exp(-(((y - at) / 1.2) ** 2)) * front
            back = 0.12 * np.exp(-(((y - at) / 3.0) ** 2)) * np.clip(-palmar, 0, 1) * (at != root)
            dark = np.maximum(dark, (fold + back) * skin.chart.share[:, d + 1])
    flat = skin.mesh.vertices[:, :2] / np.linalg.norm(skin.hand.base_mm[2])
    size = np.linalg.norm(skin.hand.base_mm[2])
    for line in _PALM_CREASES:
        reach = _distance_to_line(flat, np.array(line)) * size
        share = skin.chart.share[:, 0] * front
        dark = np.maximum(dark, 0.2 * np.exp(-((reach / 1.3) ** 2)) * share)
    return dark


def _distance_to_line(points: Array, line: Array) -> Array:
    best = np.full(len(points), np.inf)
    for a, b in pairwise(line):
        s = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - s[:, None] * (b - a), axis=1))
    return best


def _nails(skin: Skin, palmar: Array) -> Array:
    """How much of a vertex is nail, 0..1, its rim soft over a millimetre."""
    nail = np.zeros(len(palmar))
    for d in range(5):
        x, y = skin.chart.local[:, d, 0], skin.chart.local[:, d, 1]
        r = skin.hand.radius_mm[d, 3]
        middle = skin.hand.length_mm[d].sum() - 1.15 * r
        inside_mm = np.minimum(0.85 * r - np.abs(y - middle), 0.72 * r - np.abs(x))
        back = np.clip((-palmar - 0.25) / 0.2, 0, 1) * (skin.chart.share[:, d + 1] > 0.5)
        nail = np.maximum(nail, np.clip(inside_mm + 0.5, 0, 1) * back)
    return nail
