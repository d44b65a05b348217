"""How much of each image patch shows when nearer patches are painted over it.

Painter's order on a small raster: for people to look at, not for likelihoods. Patches of one digit
go on from bone to bone and do not hide each other.

>>> square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
>>> visible_shares(np.stack([square, square + (5, 0)]), np.array([1, 2])).round(1).tolist()
[0.5, 1.0]
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Longer side of the raster, and the bits of a pixel's fraction.
RASTER_PX, SUBPIXEL_BITS = 120, 4


def visible_shares(corners: Array, digit: NDArray[np.intp]) -> Array:
    """Share ``(P,)`` of each convex polygon ``(P, V, 2)``, the farthest first, that shows."""
    if not len(corners) or not np.isfinite(corners).all():
        return np.ones(len(corners))
    low = corners.min(axis=(0, 1))
    scale = (RASTER_PX - 1) / max(float(np.ptp(corners.reshape(-1, 2), axis=0).max()), 1e-9)
    fixed = np.round((corners - low) * scale * (1 << SUBPIXEL_BITS)).astype(np.int32)
    top = np.zeros((RASTER_PX, RASTER_PX), np.uint8)
    for polygon, d in zip(fixed, digit, strict=True):
        cv2.fillConvexPoly(top, polygon, int(d) + 2, cv2.LINE_8, SUBPIXEL_BITS)
    return np.array([_share(p, int(d) + 2, top) for p, d in zip(fixed, digit, strict=True)])


def _share(polygon: NDArray[np.int32], value: int, top: NDArray[np.uint8]) -> float:
    """Share of a polygon's pixels where ``top`` has its value."""
    x0, y0 = polygon.min(axis=0) >> SUBPIXEL_BITS
    x1, y1 = (polygon.max(axis=0) >> SUBPIXEL_BITS) + 2
    piece = top[y0:y1, x0:x1]
    own = np.zeros(piece.shape, np.uint8)
    moved = polygon - np.array([x0, y0], np.int32) * (1 << SUBPIXEL_BITS)
    cv2.fillConvexPoly(own, moved, 1, cv2.LINE_8, SUBPIXEL_BITS)
    total = np.count_nonzero(own)
    return np.count_nonzero(piece[own > 0] == value) / total if total else 1.0
