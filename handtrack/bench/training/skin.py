"""What skin has and smooth renders lack: creases and pores, blood under it, and hard light on it.

A network that has seen smooth hands alone doubts a real one, the more so the sharper its picture.
"""

import cv2
import numpy as np

from handtrack.bench.training.grounds import SIDE_PX, Image, Pixels, noise

_Y, _X = np.mgrid[:SIDE_PX, :SIDE_PX].astype(np.float32)
#: What more blood does to red, green and blue.
_BLOOD = np.array([0.5, -0.4, -0.5], np.float32)


def as_skin(palm_px: float, ground: Pixels, rng: np.random.Generator) -> Image:
    """Factors ``(SIDE_PX, SIDE_PX, 3)`` on the colours of a smooth hand.

    Parameters
    ----------
    palm_px : float
        Length of its palm.
    ground : (SIDE_PX, SIDE_PX, 3)
        A picture whose grain it may take.
    rng : Generator
    """
    log = np.zeros((SIDE_PX, SIDE_PX), np.float32)
    for change, share in _CHANGES:
        if rng.random() < share:
            log += change(palm_px, ground, rng)
    factors = np.repeat(np.exp(log)[..., None], 3, axis=-1)
    if rng.random() < 0.4:
        blood = noise(rng, palm_px * rng.uniform(0.15, 0.8))[..., :1]
        factors = factors * np.exp(rng.uniform(0, 0.3) * np.clip(blood, -2, 2) * _BLOOD)
    return np.asarray(factors, np.float32)


def _pores(palm_px: float, ground: Pixels, rng: np.random.Generator) -> Image:
    """Fine noise of three sizes."""
    layers = [rng.uniform(0, 0.07) * noise(rng, cell)[..., 0] for cell in (1.2, 2.5, 5.0)]
    return np.asarray(sum(layers), np.float32)


def _creases(palm_px: float, ground: Pixels, rng: np.random.Generator) -> Image:
    """Dark lines, gently bent, some of them across the whole hand."""
    lines = np.zeros((SIDE_PX, SIDE_PX), np.float32)
    along = np.linspace(-0.5, 0.5, 9)
    for _ in range(rng.poisson(12)):
        at, turn = rng.uniform(0, SIDE_PX, 2), rng.uniform(0, np.pi)
        length, bend = palm_px * rng.uniform(0.1, 1.0), rng.normal(0, 0.3)
        x, y = length * along, length * bend * along**2
        c, s = np.cos(turn), np.sin(turn)
        path = np.column_stack([c * x - s * y, s * x + c * y]) + at
        points = np.round(16 * path).astype(np.int32)
        cv2.polylines(lines, [points], False, rng.uniform(0.3, 1.0), 1, cv2.LINE_AA, 4)
    soft = cv2.GaussianBlur(lines, (0, 0), rng.uniform(0.4, 0.4 + palm_px / 60))
    return np.asarray(-rng.uniform(0.1, 0.5) * soft, np.float32)


def _grain(palm_px: float, ground: Pixels, rng: np.random.Generator) -> Image:
    """What is fine in a picture of something else, often of a face."""
    log = np.log(ground.mean(axis=-1, dtype=np.float32) + 12)
    fine = log - cv2.GaussianBlur(log, (0, 0), rng.uniform(1.5, 8))
    return np.asarray(rng.uniform(0.3, 1.2) * np.clip(fine, -0.5, 0.5), np.float32)


def _hard_light(palm_px: float, ground: Pixels, rng: np.random.Generator) -> Image:
    """A lamp on one side, darkness on the other."""
    turn, at = rng.uniform(0, 2 * np.pi), rng.normal(SIDE_PX / 2, palm_px / 2, 2)
    ahead = np.cos(turn) * (_X - at[0]) + np.sin(turn) * (_Y - at[1])
    lit = 1 / (1 + np.exp(-np.clip(ahead / (palm_px * rng.uniform(0.05, 0.6)), -30, 30)))
    dark = rng.uniform(0.1, 0.8)
    return np.asarray(np.log(dark + (1 - dark) * lit), np.float32)


_CHANGES = ((_pores, 0.4), (_creases, 0.5), (_grain, 0.4), (_hard_light, 0.2))
