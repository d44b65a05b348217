"""The brightness of a rendered picture as another camera, lamp, skin or renderer would have it."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from synth.pictures import PALM_PX, SIDE_PX, Picture

Float = NDArray[np.float32]

_Y, _X = np.mgrid[:SIDE_PX, :SIDE_PX].astype(np.float32) - SIDE_PX / 2


def exposed(picture: Picture, rng: np.random.Generator) -> Float:
    """Brightness ``(SIDE_PX, SIDE_PX)``, other every time."""
    alpha, grey = picture.alpha, picture.grey.astype(np.float32)
    rim = (alpha > 0) & (alpha < 250)
    grey[rim] = np.minimum(grey[rim] * 255.0 / alpha[rim], 255)
    for change, share in _ON_THE_HAND:
        if rng.random() < share:
            grey = change(grey, picture, rng)
    gain = rng.uniform(1, 1.6) if rng.random() < 0.3 else 1.0
    curve = np.minimum(255 * gain * np.linspace(0, 1, 256) ** rng.uniform(0.6, 1.6), 255)
    grey = curve.astype(np.float32)[np.clip(grey, 0, 255).astype(np.uint8)]
    if rng.random() < 0.5:
        grey[alpha < 100] = rng.integers(0, 256)
    grey = grey + rng.uniform(0, 5) * rng.standard_normal(grey.shape, np.float32)
    for change, share in _IN_THE_CAMERA:
        if rng.random() < share:
            grey = change(grey, picture, rng)
    return grey


def _even(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """No shading at all."""
    return np.full_like(grey, rng.uniform(40, 220))


def _blotched(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """Skin of several tones, or a pattern of light."""
    cells = int(rng.integers(3, 24))
    coarse = rng.standard_normal((cells, cells), np.float32)
    blotches = cv2.resize(coarse, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_CUBIC)
    return np.asarray(grey * np.exp(rng.uniform(0, 0.2) * blotches), np.float32)


def _rimmed(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """Darker or brighter towards the outline, as flat light and haloes make it."""
    deep = cv2.distanceTransform((picture.alpha > 128).astype(np.uint8), cv2.DIST_L2, 3)
    by = rng.uniform(-0.5, 0.5) * np.exp(-deep / rng.uniform(1, 6))
    return np.asarray(grey * (1 + by), np.float32)


def _stepped(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """A few tones only, as drawn."""
    step = rng.uniform(20, 60)
    return np.asarray(step * np.round(grey / step + 0.5), np.float32)


def _smooth(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """Skin without creases, shadows without an edge."""
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), rng.uniform(1.5, 4)), np.float32)


def _blurred(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), rng.uniform(0.5, 1.6)), np.float32)


def _sloped(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    """Light that falls off across the picture."""
    angle = rng.uniform(0, 2 * np.pi)
    slope = rng.uniform(0, 40) / PALM_PX
    return np.asarray(grey + slope * (np.cos(angle) * _X + np.sin(angle) * _Y), np.float32)


def _packed(grey: Float, picture: Picture, rng: np.random.Generator) -> Float:
    pixels = np.clip(grey, 0, 255).astype(np.uint8)
    return packed(pixels, int(rng.integers(15, 60))).astype(np.float32)


def packed(pixels: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """A picture ``(h, w)`` or ``(h, w, 3)`` in the blocks of a bad encoder."""
    ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), np.uint8) if ok else pixels


Change = Callable[[Float, Picture, np.random.Generator], Float]
#: What is done to brightness, and in what share of the lessons.
_ON_THE_HAND: tuple[tuple[Change, float], ...] = (
    (_smooth, 0.08), (_blotched, 0.25), (_rimmed, 0.15), (_stepped, 0.05), (_even, 0.05)
)  # fmt: skip
_IN_THE_CAMERA: tuple[tuple[Change, float], ...] = (
    (_blurred, 0.4), (_sloped, 0.15), (_packed, 0.15)
)  # fmt: skip
