"""A frame's silhouette as bits, and the part of the image below the wrist that does not count."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.fingers.raster import GRID, capsule_areas, pack_bits
from handtrack.hand.capsules import CapsuleHand
from handtrack.records import freeze_arrays
from handtrack.refine.view import View

Array = NDArray[np.float64]
#: Length and half width in palm-frame mm of the strip below the wrist that is left out.
STRIP_MM = 600.0


@dataclass(frozen=True, eq=False)
class SilhouetteBits:
    """Bit rows ``(GRID, WORDS)``: where the hand is seen, and what lies outside the frame."""

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
            pack_bits(cv2.resize(m * 255, (GRID, GRID), interpolation=cv2.INTER_AREA) > 127)
            for m in masks
        )
        return cls(hand, outside, GRID / size)


def below_wrist(R: Array, t_mm: Array, intrinsics: Array, wrist_y_mm: float) -> Array:
    """Quadrilaterals ``(n, 4, 2)`` in px of the half plane below the wrist line of each pose.

    The line runs through the palm's point ``(0, wrist_y, 0)``, across the image of its y axis.
    """
    fx, fy, cx, cy = intrinsics
    ends = np.array([[0.0, wrist_y_mm, 0.0], [0.0, wrist_y_mm + 20.0, 0.0]])
    X = ends @ np.swapaxes(R, -1, -2) + t_mm[:, None]
    px = X[..., :2] / np.maximum(X[..., 2:], 1.0) * (fx, fy) + (cx, cy)
    a, axis = px[:, 0], px[:, 1] - px[:, 0]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
    across = np.stack([-axis[:, 1], axis[:, 0]], axis=1)
    reach = STRIP_MM * fx / np.maximum(X[:, 0, 2:], 1.0)
    return np.stack(
        [
            a - reach * across,
            a + reach * across,
            a + reach * across - reach * axis,
            a - reach * across - reach * axis,
        ],
        axis=1,
    )


def capsule_overlap(
    hand: CapsuleHand,
    theta: Array,
    R: Array,
    t_mm: Array,
    intrinsics: Array,
    bits: SilhouetteBits,
    wrist_y_mm: float,
) -> Array:
    """Intersection over union ``(n,)`` of model and silhouette above each pose's wrist.

    ``theta`` ``(n, 20)``, ``R`` ``(n, 3, 3)``, ``t_mm`` ``(n, 3)``.
    """
    circles = hand.circles_px(theta, R, t_mm, intrinsics)
    below = below_wrist(R, t_mm, intrinsics, wrist_y_mm)
    counts = np.empty((len(theta), 3))
    capsule_areas(
        circles, hand.capsule_node, below, bits.scale, bits.hand, bits.outside, counts
    )  # fmt: skip
    model, differ, seen = counts.T
    union = 0.5 * (model + seen + differ)
    return np.asarray(np.where(union > 0, 0.5 * (model + seen - differ) / np.maximum(union, 1), 0))
