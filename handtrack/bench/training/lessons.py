"""What the proposer's network learns from: rendered pictures, made as bad as real ones.

The silhouette is eaten at, thickened, bitten into, cut at a sleeve or at the frame, has holes where
a threshold failed and lumps of what is behind; brightness is bent, noisy, blurred, blotched, with a
gradient across (:mod:`handtrack.bench.training.exposure`); the square is not quite where it should
be and turned.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.bench.training.exposure import exposed
from handtrack.proposer.network import towards_ray
from handtrack.proposer.picture import PALM_PER_DISC, Square, picture_of
from synth.pictures import PALM_PX, SIDE_PX, Picture

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Mask = NDArray[np.uint8]

#: A silhouette of fewer pixels teaches nothing.
FEWEST_PX = 300
_OPERATIONS = (cv2.MORPH_DILATE, cv2.MORPH_ERODE, cv2.MORPH_OPEN, cv2.MORPH_CLOSE)
_Y, _X = np.mgrid[:SIDE_PX, :SIDE_PX].astype(np.float32)


@dataclass(frozen=True, eq=False)
class Lesson:
    """What the network sees, and what it should say."""

    seen: Float  # (2, side, side)
    theta: Float  # (20,) radians
    R: Float  # (3, 3) palm to camera, as if the palm lay on the square's axis
    place: Float  # (3,) where the palm lies over the disc's radius, and log of its length over that


def lesson_from(
    picture: Picture, rng: np.random.Generator, off_upright: float | None = None
) -> Lesson:
    """A lesson, other every time.

    With ``off_upright`` the fingers point up in the square to within so many radians, as in a track
    (a standard deviation); else they point anywhere a start may have it.
    """
    mask = (picture.alpha > 128).astype(np.uint8)
    for spoil, share in _SPOILS:
        if rng.random() < share:
            spoiled = spoil(mask, picture, rng)
            mask = spoiled if cv2.countNonZero(spoiled) > FEWEST_PX else mask
    square = _square(mask, picture, rng)
    if off_upright is not None:
        fingers = np.arctan2(picture.R[0, 1], -picture.R[1, 1])
        square = replace(square, turn=float(fingers + rng.normal(0, off_upright)))
    seen = picture_of(exposed(picture, rng), mask > 0, square)
    ray = (picture.at_px - (SIDE_PX - 1) / 2) / picture.focal_px
    back = rotation.about_z(-square.turn)
    R = back @ towards_ray(ray).T @ picture.R
    at = back[:2, :2] @ (picture.at_px - square.centre_px) / square.radius_px
    place = np.array([*at, np.log(PALM_PX / square.radius_px)])
    return Lesson(
        seen=seen,
        theta=picture.theta.astype(np.float32),
        R=R.astype(np.float32),
        place=place.astype(np.float32),
    )


def _square(mask: Mask, picture: Picture, rng: np.random.Generator) -> Square:
    """About the palm's disc or about the palm, as starts and as tracks give it, roughly upright."""
    turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.12 else rng.normal(0, np.radians(40))
    x, y = picture.at_px
    low = np.maximum((picture.at_px - PALM_PX).astype(int), 0)
    near = cv2.distanceTransform(mask, cv2.DIST_L2, 5)[
        low[1] : int(y + PALM_PX), low[0] : int(x + PALM_PX)
    ]
    _, radius, _, at = cv2.minMaxLoc(near)
    if rng.random() < 0.5 and radius > 4:
        return Square(
            low + at + rng.normal(0, 1.5, 2), radius * np.exp(rng.normal(0, 0.08)), float(turn)
        )
    centre = picture.at_px + rng.normal(0, 0.12 * PALM_PX, 2)
    return Square(centre, PALM_PX / PALM_PER_DISC * np.exp(rng.normal(0, 0.12)), float(turn))


def _rough(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    size = 3 if rng.random() < 0.7 else 5
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.morphologyEx(mask, _OPERATIONS[rng.integers(4)], kernel), np.uint8)


def _rim(mask: Mask) -> NDArray[np.intp]:
    """Pixels ``(n, 2)`` along the outline, row and column."""
    kernel = np.ones((3, 3), np.uint8)
    return np.argwhere(cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, kernel))


def _bitten(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    """Bites and lumps at the outline."""
    bitten = mask.copy()
    rim = _rim(mask)
    for y, x in rim[rng.integers(len(rim), size=rng.integers(1, 4))].tolist():
        size = int(rng.integers(2, 6 if rng.random() < 0.8 else 13))
        cv2.circle(bitten, (x, y), size, int(rng.random() < 0.4), -1)
    return bitten


def _holed(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    """The darkest or the brightest is not taken for skin."""
    inside = mask > 0
    smooth = cv2.GaussianBlur(picture.grey, (0, 0), 1.0)
    share = rng.uniform(0.01, 0.1)
    low, high = np.quantile(smooth[inside], (share, 1 - share))
    return mask * (smooth >= low if rng.random() < 0.6 else smooth <= high).astype(np.uint8)


def _lumped(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    """Something behind the hand is taken for skin."""
    lumped = mask.copy()
    rim = _rim(mask)
    y, x = rim[rng.integers(len(rim))].tolist()
    axes = rng.integers(4, 24, 2).tolist()
    cv2.ellipse(lumped, (x, y), axes, float(rng.uniform(0, 180)), 0, 360, 1, -1)
    return lumped


def _sleeved(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    """The arm ends somewhere below the palm."""
    along = picture.R[:2, 1] / max(float(np.linalg.norm(picture.R[:2, 1])), 0.3)
    return mask * (_along(picture, along) > -PALM_PX * rng.uniform(0.5, 1.6))


def _cut(mask: Mask, picture: Picture, rng: np.random.Generator) -> Mask:
    """The frame ends in the hand."""
    angle = rng.uniform(0, 2 * np.pi)
    along = _along(picture, np.array([np.cos(angle), np.sin(angle)]))
    return mask * (along < PALM_PX * rng.uniform(0.5, 1.5))


def _along(picture: Picture, way: Array) -> Float:
    x, y = picture.at_px
    return np.asarray((_X - x) * way[0] + (_Y - y) * way[1], np.float32)


Spoil = Callable[[Mask, Picture, np.random.Generator], Mask]
#: What is done to a silhouette, and in what share of the lessons.
_SPOILS: tuple[tuple[Spoil, float], ...] = (
    (_holed, 0.1), (_lumped, 0.08), (_rough, 0.5), (_bitten, 0.25), (_sleeved, 0.5), (_cut, 0.08)
)  # fmt: skip
