"""What is behind the hand: plain, gradient, clutter (procedural), or an image of the user's.

>>> background("plain", 64, 48, np.random.default_rng(0)).shape
(48, 64, 3)
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError

Array = NDArray[np.float64]
KINDS = ("plain", "gradient", "clutter", "wood")


def background(kind: str, width: int, height: int, rng: np.random.Generator) -> Array:
    """An image ``(height, width, 3)`` in 0..255; ``kind`` is one of `KINDS` or a file.

    Raises
    ------
    InputError
        It is neither.
    """
    if kind == "plain":
        return _plain(width, height, rng)
    if kind == "gradient":
        return _gradient(width, height, rng)
    if kind == "clutter":
        return _clutter(width, height, rng)
    if kind == "wood":
        return _wood(width, height, rng)
    image = cv2.imread(kind, cv2.IMREAD_COLOR) if Path(kind).is_file() else None
    if image is None:
        raise InputError(
            f"background '{kind}': not one of {', '.join(KINDS)}, nor a readable image"
        )
    return cv2.resize(image[..., ::-1], (width, height), interpolation=cv2.INTER_AREA).astype(float)


def _shade(width: int, height: int, rng: np.random.Generator) -> Array:
    """Light that falls off to one side, about 1: ``(height, width, 1)``."""
    y, x = np.mgrid[0:height, 0:width]
    angle = rng.uniform(0, 2 * np.pi)
    along = (x / width - 0.5) * np.cos(angle) + (y / height - 0.5) * np.sin(angle)
    return 1.0 + 0.18 * along[..., None]


def _plain(width: int, height: int, rng: np.random.Generator) -> Array:
    grey = rng.uniform(110, 205)
    colour = grey + rng.uniform(-12, 12, 3) * (1.0, 0.5, 1.0)
    return np.clip(colour * _shade(width, height, rng), 0, 255)


def _gradient(width: int, height: int, rng: np.random.Generator) -> Array:
    ends = rng.uniform(60, 210, (2, 1)) + rng.uniform(-25, 25, (2, 3)) * (1.0, 0.6, 1.0)
    s = np.linspace(0, 1, height)[:, None, None]
    return np.clip((ends[0] * (1 - s) + ends[1] * s) * _shade(width, height, rng), 0, 255)


def _smooth_noise(width: int, height: int, cell: float, rng: np.random.Generator) -> Array:
    coarse = rng.normal(size=(int(height / cell) + 3, int(width / cell) + 3))
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


def _wood(width: int, height: int, rng: np.random.Generator) -> Array:
    """Boards of about the colour of skin."""
    y, x = np.mgrid[0:height, 0:width].astype(float)
    bent = x + 14 * _smooth_noise(width, height, 120, rng)
    grain = np.sin(bent * rng.uniform(0.25, 0.5) + 2 * _smooth_noise(width, height, 25, rng))
    fine = _smooth_noise(width, height, 3, rng)
    tone = np.array([172, 124, 84.0]) * rng.uniform(0.8, 1.15)
    wood = tone * (1 + 0.09 * grain + 0.05 * fine)[..., None]
    board = rng.uniform(70, 150)
    wood *= 1 - 0.45 * np.exp(-(((y % board) / 2.0) ** 2))[..., None]
    return np.clip(wood * _shade(width, height, rng), 0, 255)


def _clutter(width: int, height: int, rng: np.random.Generator) -> Array:
    """A desk: wood, books, mugs, cables and printed sheets, out of focus a little."""
    image = np.ascontiguousarray(_wood(width, height, rng))
    for _ in range(16):
        colour = [float(c) for c in rng.uniform(20, 235, 3)]
        centre = rng.uniform(0, 1, 2) * (width, height)
        size = rng.uniform(30, 130, 2)
        box = cv2.boxPoints((centre.tolist(), size.tolist(), float(rng.uniform(0, 180))))
        what = rng.integers(0, 4)
        if what < 2:
            cv2.fillPoly(image, [box.astype(np.int32)], colour)
            edge = [0.6 * c for c in colour]
            cv2.polylines(image, [box.astype(np.int32)], True, edge, 2, cv2.LINE_AA)
        elif what == 2:
            axes = (size / 2).astype(int).tolist()
            cv2.ellipse(
                image, centre.astype(int).tolist(), axes, 0, 0, 360, colour, -1, cv2.LINE_AA
            )
        else:
            path = centre + np.cumsum(rng.normal(0, 30, (12, 2)), axis=0)
            cv2.polylines(image, [path.astype(np.int32)], False, colour, 4, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(np.clip(image, 0, 255), (0, 0), 1.2))
