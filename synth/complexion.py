"""Colours of hands and bodies that others modelled, vertex by vertex."""

import numpy as np
from numpy.typing import NDArray

from synth.arm import FIRST_DIGIT, Arm
from synth.makehuman import Body
from synth.tones import TONES, linear

Array = NDArray[np.float64]

#: Share of the people whose cloth has about their skin's colour.
_NUDE = 0.12
#: How a redder spot dims red, green and blue, and where in a face there are such spots: mouth, nose
#: and cheeks, mm from between the eyes, and how large.
_RED = np.array([0.2, 1.0, 1.0])
_REDDER = ((0, 65, -60, 22), (0, 25, -75, 18), (40, 30, -40, 25), (-40, 30, -40, 25))


def of_arm(arm: Arm, tone: Array, rng: np.random.Generator) -> Array:
    """Linear colours ``(n, 4)``: paler in the palm, redder at the joints and the tips, nails."""
    v, joints = arm.mesh.vertices, arm.joints_mm
    palmar = arm.mesh.normals(arm.mesh.vertices)[:, 2]
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


def of_body(body: Body, tone: Array, cloth: Array, rng: np.random.Generator) -> Array:
    """Linear colours ``(n, 4)`` of skin, hair, eyes and cloth, now and then of skin's colour.

    Parameters
    ----------
    body : Body
    tone, cloth : (3,)
        Linear.
    rng : numpy.random.Generator
    """
    v = body.mesh.vertices
    colour = np.tile(tone, (len(v), 1)) * (1 + rng.normal(0, 0.03, (len(v), 1)))
    for x, y, z, size in _REDDER:
        near = np.exp(-((np.linalg.norm(v - (x, y, z), axis=1) / size) ** 2))
        colour *= 1 - rng.uniform(0, 0.35) * near[:, None] * _RED
    if rng.random() < _NUDE:
        cloth = tone * rng.uniform(0.6, 1.3)
    stripes = np.sin(v[:, 1] * rng.uniform(0.05, 0.4)) > rng.uniform(-1, 2)
    woven = cloth * (1 - rng.uniform(0, 0.5) * stripes[:, None])
    colour[body.clothed] = woven[body.clothed]
    colour[body.hair] = rng.uniform(0.005, 0.2) * np.array([1.0, rng.uniform(0.6, 1), 0.5])
    colour[body.eyes] = 0.6
    iris = body.eyes & (v[:, 2] < np.quantile(v[body.eyes, 2], 0.2))
    colour[iris] = rng.uniform(0.01, 0.1)
    return _opaque(colour)


def some_tone(rng: np.random.Generator) -> Array:
    """Linear reflectance ``(3,)`` of somebody's skin."""
    one, other = (np.array(TONES[str(name)], float) for name in rng.choice(list(TONES), 2))
    w = rng.random()
    return linear((w * one + (1 - w) * other) * np.exp(rng.normal(0, 0.05, 3)))


def _opaque(colour: Array) -> Array:
    return np.column_stack([np.clip(colour, 0, 1), np.ones(len(colour))])
