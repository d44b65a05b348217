"""What may stand before and behind a hand: photographs, textures, and shapes of either.

Nothing of :mod:`synth.background` is among it, so that clips of the benchmark show what was not
learned. Much of it has the colour of skin.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError

#: Colours or shares, 0 to 255 or 0 to 1.
Image = NDArray[Any]
Pixels = NDArray[np.uint8]
Mask = NDArray[np.uint8]

#: Side of a ground in pixels.
SIDE_PX = 128
#: Share of the grounds that are people, of the others that are photographs, and of either in other
#: colours.
_PEOPLE, _PHOTOGRAPHS, _RECOLOURED_PEOPLE, _RECOLOURED = 0.4, 0.5, 0.12, 0.4
_Y, _X = np.mgrid[:SIDE_PX, :SIDE_PX].astype(np.float32)


def photographs(folder: Path) -> list[Pixels]:
    """The images ``(h, w, 3)`` of a folder, in which no hands should be.

    Raises
    ------
    InputError
        There is none.
    """
    read = [cv2.imread(str(path), cv2.IMREAD_COLOR_RGB) for path in sorted(folder.iterdir())]
    found = [image for image in read if image is not None and min(image.shape[:2]) >= SIDE_PX]
    if not found:
        raise InputError(f"{folder}: no images of {SIDE_PX} px or more")
    return [np.asarray(image, np.uint8) for image in found]


def ground(photos: list[Pixels], people: list[Pixels], rng: np.random.Generator) -> Pixels:
    """What stands behind a hand ``(SIDE_PX, SIDE_PX, 3)``: a person, or anything."""
    if people and rng.random() < _PEOPLE:
        sides = (0.6, 1.35) if rng.random() < 0.85 else (0.25, 1.0)
        image = _crop(people[rng.integers(len(people))], sides, rng)
        if rng.random() < _RECOLOURED_PEOPLE:
            image = _recoloured(image, rng)
        return np.clip(image, 0, 255).astype(np.uint8)
    if photos and rng.random() < _PHOTOGRAPHS:
        image = _crop(photos[rng.integers(len(photos))], (0.25, 1.0), rng)
        if rng.random() < _RECOLOURED:
            image = _recoloured(image, rng)
    else:
        image = texture(rng)
    for _ in range(rng.poisson(3.0) if rng.random() < 0.6 else 0):
        inside = some_shape(rng)[..., None] > 0
        image = np.where(inside, texture(rng) if rng.random() < 0.5 else _even(rng), image)
    return np.clip(image, 0, 255).astype(np.uint8)


def texture(rng: np.random.Generator) -> Image:
    """A material ``(SIDE_PX, SIDE_PX, 3)``: even, mottled, striped, or in waves of light."""
    draw = _TEXTURES[rng.choice(len(_TEXTURES), p=(0.2, 0.35, 0.25, 0.2))]
    return np.asarray(np.clip(sloped(draw(rng), rng, 0.4), 0, 255), np.float32)


def some_shape(rng: np.random.Generator) -> Mask:
    """An ellipse, a box, a cable or a polygon anywhere, ``(SIDE_PX, SIDE_PX)``, 1 inside."""
    mask = np.zeros((SIDE_PX, SIDE_PX), np.uint8)
    centre = rng.uniform(0, SIDE_PX, 2)
    kind, turn = rng.integers(4), float(rng.uniform(0, 180))
    if kind == 0:
        axes = rng.integers(4, 45, 2).tolist()
        cv2.ellipse(mask, centre.astype(int).tolist(), axes, turn, 0, 360, 1, -1)
    elif kind == 1:
        box = cv2.boxPoints((centre.tolist(), rng.uniform(4, 90, 2).tolist(), turn))
        cv2.fillPoly(mask, [box.astype(np.int32)], 1)
    elif kind == 2:
        path = (centre + np.cumsum(rng.normal(0, 14, (8, 2)), axis=0)).astype(np.int32)
        cv2.polylines(mask, [path], False, 1, int(rng.integers(1, 12)))
    else:
        corners = centre + rng.normal(0, 25, (int(rng.integers(3, 8)), 2))
        cv2.fillPoly(mask, [corners.astype(np.int32)], 1)
    return mask


def some_skin(rng: np.random.Generator) -> Image:
    """A chromaticity ``(3,)`` as skin has it in light of about any colour, at most 1."""
    log_rg, log_gb = rng.normal((0.30, 0.22), (0.12, 0.16))
    colour = np.exp([log_rg, 0.0, -log_gb])
    return np.asarray(colour / colour.max(), np.float32)


def some_colour(rng: np.random.Generator) -> Image:
    """Any colour ``(3,)``, 0 to 255, often that of skin."""
    if rng.random() < 0.35:
        return some_skin(rng) * np.float32(rng.uniform(40, 250))
    return rng.uniform(5, 250, 3).astype(np.float32)


def noise(rng: np.random.Generator, cell_px: float) -> Image:
    """Smooth noise ``(SIDE_PX, SIDE_PX, 3)`` of unit deviation with features of a size."""
    n = int(SIDE_PX / cell_px) + 3
    coarse = rng.standard_normal((n, n, 3), np.float32)
    wide = cv2.resize(coarse, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_CUBIC)
    return np.asarray(wide, np.float32)


def sloped(image: Image, rng: np.random.Generator, most: float) -> Image:
    """``image`` in light that falls off across it."""
    angle = rng.uniform(0, 2 * np.pi)
    along = np.cos(angle) * (2 * _X / SIDE_PX - 1) + np.sin(angle) * (2 * _Y / SIDE_PX - 1)
    return image * (1 + np.float32(rng.uniform(0, most)) * along.astype(np.float32))[..., None]


def _crop(photo: Pixels, sides: tuple[float, float], rng: np.random.Generator) -> Image:
    """A square of a photograph, of a side between such shares of its own."""
    h, w = photo.shape[:2]
    side = rng.uniform(*sides) * min(h, w)
    step, turn = side / SIDE_PX, rng.uniform(-0.5, 0.5)
    c, s = step * np.cos(turn), step * np.sin(turn)
    x, y = (rng.uniform(*sorted((0.0, length - side))) for length in (w, h))
    A = np.array([[c, -s, x], [s, c, y]])
    soft = cv2.GaussianBlur(photo, (0, 0), 0.4 * step) if step > 1 else photo
    flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REFLECT
    crop = cv2.warpAffine(soft, A, (SIDE_PX, SIDE_PX), flags=flags, borderMode=border)
    return np.asarray(crop, np.float32)


def _recoloured(image: Image, rng: np.random.Generator) -> Image:
    """Channels in another order, or everything in one hue, often that of skin."""
    if rng.random() < 0.5:
        return image[..., rng.permutation(3)]
    hue = some_skin(rng) if rng.random() < 0.6 else some_colour(rng) / np.float32(200)
    return np.asarray(image.mean(axis=-1, keepdims=True) * hue * np.float32(1.2), np.float32)


def _even(rng: np.random.Generator) -> Image:
    return np.broadcast_to(some_colour(rng), (SIDE_PX, SIDE_PX, 3))


def _mottled(rng: np.random.Generator) -> Image:
    image = _even(rng)
    hue = np.ones(3, np.float32) if rng.random() < 0.6 else rng.uniform(-1, 1, 3).astype(np.float32)
    for cell in (64, 24, 8, 3):
        grain = noise(rng, cell)
        image = image + np.float32(rng.uniform(0, 28)) * grain[..., :1] * hue
    return np.asarray(image, np.float32)


def _striped(rng: np.random.Generator) -> Image:
    angle = rng.uniform(0, np.pi)
    along = np.cos(angle) * _X + np.sin(angle) * _Y + rng.uniform(0, 8) * noise(rng, 32)[..., 0]
    wave = np.sin(rng.uniform(0.1, 1.2) * along + 2 * noise(rng, 12)[..., 0] * rng.random())
    if rng.random() < 0.4:
        wave = np.sign(wave)
    stripes = wave[..., None] * rng.uniform(3, 40) * some_colour(rng) / 128
    return np.asarray(_mottled(rng) + stripes, np.float32)


def _waves(rng: np.random.Generator) -> Image:
    """Folds of cloth: light and shade without another colour."""
    folds = noise(rng, rng.uniform(4, 60))[..., :1]
    return np.asarray(_even(rng) * np.exp(rng.uniform(0.05, 0.5) * folds), np.float32)


_TEXTURES: tuple[Callable[[np.random.Generator], Image], ...] = (_even, _mottled, _striped, _waves)
