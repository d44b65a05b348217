"""Five fingertips on the outline of a silhouette.

The palm is the largest disc in the silhouette (centre ``c``, radius ``r``, by the distance
transform), and every length below is in ``r``, so nothing depends on the size of the picture.
The outline is resampled to steps of ``r / 32`` and smoothed. With arms of half ``r`` along it the
k-cosine at a point ``p_i`` is::

    cos(p_{i-k} - p_i, p_{i+k} - p_i),   k = 16 steps

A **tip** is a maximum of it where the outline is convex, far from the palm, clear of the image
border, and narrow: a sleeve's corner is as sharp as a finger but grows wider behind its point.
Five tips in a row along the outline are a hand; the wrist lies in the gap between the last and
the first.

>>> import numpy as np
>>> centre, radius, outline = next(palm_candidates(np.ones((65, 65), bool)))
>>> centre.tolist(), round(radius)
([32.0, 32.0], 33)
"""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from calib.seen import Seen

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEPS_PER_RADIUS = 32
ARM = STEPS_PER_RADIUS // 2
SMOOTHING_R = 0.045  # 2 px on a hand of 200 px
MIN_COSINE = 0.25
MIN_TIP_DISTANCE_R = 1.35
MAX_TIP_WIDTH_R = 0.75
MAX_TIP_GROWTH = 1.4
MIN_PALM_RADIUS_PX = 6.0


def palm_candidates(mask: Mask) -> Iterator[tuple[Array, float, Array]]:
    """Up to three discs ``(centre, radius, outline)`` that may be palms, the largest first."""
    binary = np.ascontiguousarray(mask, dtype=np.uint8)
    outlines, _ = cv2.findContours(binary, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outlines = [o for o in outlines if len(o) >= 8]
    if not outlines:
        return
    outline = max(outlines, key=cv2.contourArea)
    filled = np.zeros((binary.shape[0] + 2, binary.shape[1] + 2), np.uint8)
    cv2.drawContours(filled, [outline], 0, 1, cv2.FILLED, offset=(1, 1))
    distance = cv2.distanceTransform(filled, cv2.DIST_L2, 5)[1:-1, 1:-1]
    largest = 0.0
    for _ in range(3):
        _, radius, _, (x, y) = cv2.minMaxLoc(distance)
        largest = max(largest, radius)
        if radius < max(MIN_PALM_RADIUS_PX, 0.5 * largest):
            return
        yield np.array([x, y], float), float(radius), outline[:, 0].astype(float)
        cv2.circle(distance, (x, y), round(2.2 * radius), 0.0, cv2.FILLED)


def resampled(outline: Array, radius: float) -> Array:
    """The outline in steps of ``radius / 32``, smoothed, moved from pixel centres to the edge."""
    closed = np.vstack([outline, outline[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    n = round(arc[-1] * STEPS_PER_RADIUS / radius)
    at = np.arange(n) * arc[-1] / max(n, 1)
    points = np.stack([np.interp(at, arc, closed[:, i]) for i in (0, 1)], axis=1)
    points = gaussian_filter1d(points, SMOOTHING_R * STEPS_PER_RADIUS, axis=0, mode="wrap")
    return np.asarray(points + 0.5 * _normals(points))


def _normals(points: Array) -> Array:
    """Outward unit normals of a closed outline."""
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    x, y = points.T
    area = float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) * np.sign(area)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9))


def five_tips(
    contour: Array, centre: Array, radius: float, clear: NDArray[np.bool_]
) -> tuple[NDArray[np.int64] | None, Seen]:
    """Indices of five tips in contour order, the wrist's gap between the last and the first."""
    tips = _tips(contour, centre, radius, clear)
    if len(tips) < 5:
        return None, Seen.FEW_TIPS
    angle = np.arctan2(*(contour[tips] - centre).T[::-1])
    turn = np.sign(signed_area(contour))
    gap = np.mod(turn * (np.roll(angle, -1) - angle), 2 * np.pi)
    tips = np.roll(tips, -(int(np.argmax(gap)) + 1))
    if len(tips) > 5:
        return None, Seen.MANY_TIPS
    inside = np.arange(tips[0], tips[0] + (tips[-1] - tips[0]) % len(contour)) % len(contour)
    if not clear[inside].all():
        return None, Seen.CLIPPED
    return tips, Seen.OPEN_HAND


def _tips(
    contour: Array, centre: Array, radius: float, clear: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Indices of the points that look like fingertips, in contour order."""

    def arms(k: int) -> tuple[Array, Array]:
        return np.roll(contour, k, axis=0) - contour, np.roll(contour, -k, axis=0) - contour

    a, b = arms(ARM)
    A, B = arms(2 * ARM)
    dot = np.sum(a * b, axis=1)
    cosine = dot / np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-9)
    convex = (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]) * np.sign(signed_area(contour)) > 0
    width = np.linalg.norm(a - b, axis=1)
    ok = (
        convex
        & (cosine > MIN_COSINE)
        & (np.linalg.norm(contour - centre, axis=1) > MIN_TIP_DISTANCE_R * radius)
        & (width < MAX_TIP_WIDTH_R * radius)
        & (np.linalg.norm(A - B, axis=1) < MAX_TIP_GROWTH * width)
        & clear
    )
    score = np.where(ok, cosine, -1.0)
    peak = ok & (score == maximum_filter1d(score, 2 * STEPS_PER_RADIUS + 1, mode="wrap"))
    peaks = _one_of_each_run(np.flatnonzero(peak), len(contour))
    return np.array([_outermost(contour, int(i)) for i in peaks], np.int64)


def _one_of_each_run(indices: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """The first of every run of equal peaks on a closed outline of ``n`` points."""
    if not len(indices):
        return indices
    keep = np.diff(indices, prepend=indices[-1] - n) > STEPS_PER_RADIUS
    return np.asarray(indices[keep])


def _outermost(contour: Array, i: int) -> int:
    """The point near ``i`` that lies farthest out along the finger's own axis."""
    n = len(contour)
    axis = contour[i] - (contour[(i - 2 * ARM) % n] + contour[(i + 2 * ARM) % n]) / 2
    near = (i + np.arange(-ARM, ARM + 1)) % n
    return int(near[np.argmax(contour[near] @ axis)])


def signed_area(points: Array) -> float:
    """Area of a closed outline ``(n, 2)``, positive if it runs from x to y."""
    x, y = points.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def clear_of_border(visible: Mask) -> Mask:
    """Pixels ``(h, w)`` at least 2 px inside the picture."""
    edge = np.asarray(visible, np.uint8)
    square = np.ones((5, 5), np.uint8)
    return np.asarray(cv2.erode(edge, square, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0)


def values_at(picture: Mask, points: Array) -> NDArray[np.bool_]:
    """The values of ``picture`` ``(h, w)`` at the nearest pixels of ``points`` ``(n, 2)``."""
    height, width = picture.shape
    x, y = np.round(points).astype(int).T
    return np.asarray(picture[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)])


def unit(vector: Array) -> Array:
    """The direction of a plane vector ``(2,)``."""
    return np.asarray(vector / np.linalg.norm(vector))
