"""A frame's silhouette as bits, and the forearm in it, which does not count.

Real hands come with an arm. Below the wrist a strip is left out of every comparison: as wide as the
wrist and a little more, in the direction in which the silhouette goes on farthest. It is only a
strip: were everything below the wrist left out, a model that sits on the forearm and has the
hand itself below its wrist would fit perfectly.
"""

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.fingers.raster import GRID, capsule_areas, pack_bits
from handtrack.hand.capsules import CapsuleHand
from handtrack.records import freeze_arrays
from handtrack.refine.view import View

Array = NDArray[np.float64]
#: Length of the forearm strip, and how far along it the silhouette is followed.
STRIP_MM, FOLLOWED_MM = 600.0, 130.0
#: Directions tried, from the palm's axis.
BENT_RAD = np.radians(np.arange(-45.0, 46.0, 9.0))
#: Where along the strip the silhouette is asked for.
STEPS_MM = np.linspace(0.1, 1.0, 14) * FOLLOWED_MM
#: Half width at the wrist in wrist radii, and what it grows by for each mm along the strip.
WIDTH, GROWTH = 1.3, 0.12


@dataclass(frozen=True, eq=False)
class SilhouetteBits:
    """Bit rows ``(GRID, WORDS)``: where the hand is seen, and what lies outside the frame."""

    grid: NDArray[np.bool_]  # (GRID, GRID) hand or outside the frame
    hand: NDArray[np.uint64]
    outside: NDArray[np.uint64]
    scale: float  # grid cells to a pixel of the window

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of(cls, view: View) -> "SilhouetteBits":
        """The bits of a view; the grid covers the window's longer side."""
        h, w = view.sdf.shape
        size = max(h, w)
        masks = np.zeros((2, size, size), np.uint8)
        masks[0, :h, :w] = view.sdf < 0
        masks[1] = 1
        x0, y0, x1, y1 = view.valid.astype(int)
        masks[1, y0:y1, x0:x1] = 0
        hand, outside = (
            cv2.resize(m * 255, (GRID, GRID), interpolation=cv2.INTER_AREA) > 127 for m in masks
        )
        return cls(hand | outside, pack_bits(hand), pack_bits(outside), GRID / size)


def forearm_strip(
    R: Array,
    t_mm: Array,
    intrinsics: Array,
    bits: SilhouetteBits,
    wrist_y_mm: float,
    wrist_radius_mm: float,
) -> Array:
    """Quadrilaterals ``(n, 4, 2)`` in px of the strip below the wrist of each pose.

    ``R`` ``(n, 3, 3)``, ``t_mm`` ``(n, 3)``. The strip begins at the palm's point
    ``(0, wrist_y, 0)``.
    """
    fx, fy, cx, cy = intrinsics
    ends = np.array([[0.0, wrist_y_mm, 0.0], [0.0, wrist_y_mm + 20.0, 0.0]])
    X = ends @ np.swapaxes(R, -1, -2) + t_mm[:, None]
    px = X[..., :2] / np.maximum(X[..., 2:], 1.0) * (fx, fy) + (cx, cy)
    wrist, down = px[:, 0], px[:, 0] - px[:, 1]
    down = down / np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)
    px_per_mm = (fx / np.maximum(X[:, 0, 2], 1.0))[:, None]
    way = np.empty_like(down)
    _farthest(wrist, down, px_per_mm[:, 0], bits.grid, bits.scale, BENT_RAD, STEPS_MM, way)
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    near = WIDTH * wrist_radius_mm * px_per_mm
    far = near + GROWTH * STRIP_MM * px_per_mm
    end = wrist + STRIP_MM * px_per_mm * way
    return np.stack(
        [wrist - near * across, wrist + near * across, end + far * across, end - far * across],
        axis=1,
    )


@numba.njit(cache=True, nogil=True)
def _farthest(wrist, down, px_per_mm, grid, scale, bent, steps_mm, way):  # type: ignore[no-untyped-def]
    """Into ``way`` ``(n, 2)``, of the directions about ``down``, that which stays inside longest.

    Of directions alike, the straighter; what lies beyond the window counts as inside.
    """
    rows, columns = grid.shape
    for n in range(len(wrist)):
        most = -np.inf
        for b in range(len(bent)):
            c, s = np.cos(bent[b]), np.sin(bent[b])
            x = c * down[n, 0] - s * down[n, 1]
            y = s * down[n, 0] + c * down[n, 1]
            inside = -1e-3 * abs(bent[b])
            for k in range(len(steps_mm)):
                step = steps_mm[k] * px_per_mm[n]
                column = int((wrist[n, 0] + x * step + 0.5) * scale)
                row = int((wrist[n, 1] + y * step + 0.5) * scale)
                known = 0 <= row < rows and 0 <= column < columns
                inside += not known or grid[row, column]
            if inside > most:
                most, way[n, 0], way[n, 1] = inside, x, y


def capsule_overlap(
    hand: CapsuleHand,
    theta: Array,
    R: Array,
    t_mm: Array,
    intrinsics: Array,
    bits: SilhouetteBits,
    wrist_y_mm: float,
) -> Array:
    """Intersection over union ``(n,)`` of model and silhouette, without the forearm.

    ``theta`` ``(n, 20)``, ``R`` ``(n, 3, 3)``, ``t_mm`` ``(n, 3)``.
    """
    circles = hand.circles_px(theta, R, t_mm, intrinsics)
    strip = forearm_strip(R, t_mm, intrinsics, bits, wrist_y_mm, hand.shape.wrist_radius_mm)
    counts = np.empty((len(theta), 3))
    capsule_areas(
        circles, hand.capsule_node, strip, bits.scale, bits.hand, bits.outside, counts
    )  # fmt: skip
    model, differ, seen = counts.T
    union = 0.5 * (model + seen + differ)
    return np.asarray(np.where(union > 0, 0.5 * (model + seen - differ) / np.maximum(union, 1), 0))
