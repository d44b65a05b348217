"""How much of each image patch shows when nearer patches are painted over it.

Painter's order on a small raster, looked up at points spread over each patch: for people to look
at, not for likelihoods. Patches of one digit go on from bone to bone and do not hide each other.

>>> square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
>>> visible_shares(np.stack([square, square + (5, 0)]), np.array([1, 2])).tolist()
[0.5, 1.0]
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Longer side of the raster, and the bits of a pixel's fraction.
RASTER_PX, SUBPIXEL_BITS = 120, 4
#: Where points lie between the middle of a patch and its corners.
SPREAD = (0.3, 0.6, 0.85)


def visible_shares(corners: Array, digit: NDArray[np.intp]) -> Array:
    """Share ``(P,)`` of each convex polygon ``(P, V, 2)``, the farthest first, that shows."""
    if not len(corners) or not np.isfinite(corners).all():
        return np.ones(len(corners))
    low = corners.min(axis=(0, 1))
    scale = (RASTER_PX - 1) / max(float((corners.max(axis=(0, 1)) - low).max()), 1e-9)
    px = (corners - low) * scale
    fixed = np.round(px * (1 << SUBPIXEL_BITS)).astype(np.int32)
    top = np.zeros((RASTER_PX, RASTER_PX), np.uint8)
    for polygon, value in zip(fixed, (digit + 2).tolist(), strict=True):
        cv2.fillConvexPoly(top, polygon, value, cv2.LINE_8, SUBPIXEL_BITS)
    middle = px.mean(axis=1, keepdims=True)
    points = np.concatenate([middle + share * (px - middle) for share in SPREAD], axis=1)
    x, y = np.moveaxis(np.rint(points).astype(int), -1, 0)  # (P, 3 V)
    return np.asarray((top[y, x] == digit[:, None] + 2).mean(axis=1))
