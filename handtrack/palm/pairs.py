"""Reduce matches to weighted pairs for a solver: robust weights, and the extra points.

A pair's error weighs ``w (n n^T + tau (I - n n^T))``: across the edge's normal in full, along it
by the share ``tau``, because an edge point says where the outline is, not which point of it. The
extra points of Section 5 (fingertips, finger roots) are known pairs: ``tau = 1``.

>>> import numpy as np
>>> pairs = Pairs.of(np.zeros((2, 3)), np.zeros((2, 2)), np.ones(2), np.eye(2), 0.1)
>>> len(pairs.joined(pairs).weights), pairs.tangential.tolist()
(4, [0.1, 0.1])
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.correspondence import EdgePoints, Matches
from handtrack.palm.outline import Outline
from handtrack.palm.robust import Kind, robust_weights
from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]


class Pairs(NamedTuple):
    """Palm points, image points, weights (1/px^2), edge normals, tangential shares."""

    points_mm: Array  # (p, 3)
    images_px: Array  # (p, 2)
    weights: Array  # (p,)
    normals: Array  # (p, 2)
    tangential: Array  # (p,)

    @classmethod
    def of(
        cls, points: Array, images: Array, weights: Array, normals: Array, tangential: float
    ) -> "Pairs":
        """Pairs of one tangential share."""
        return cls(points, images, weights, normals, np.full(len(points), tangential))

    def joined(self, other: "Pairs") -> "Pairs":
        """These pairs, then those."""
        return Pairs(*(np.concatenate(both) for both in zip(self, other, strict=True)))


@dataclass(frozen=True, eq=False)
class ExtraPoints:
    """Pairs known beforehand; the weight of an outline sample is 1."""

    points_mm: Array  # (k, 3)
    images_px: Array  # (k, 2)
    weights: Array  # (k,)

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of(cls, extra: tuple[ArrayLike, ArrayLike, ArrayLike] | None) -> "ExtraPoints":
        """From ``(points_mm, points_px, weights)`` or None; rows that are not finite go.

        Raises
        ------
        InputError
            The shapes do not go together, or a weight is negative.
        """
        if extra is None:
            return cls(np.empty((0, 3)), np.empty((0, 2)), np.empty(0))
        points, images, weights = (np.array(part, float) for part in extra)
        k = len(points)
        if points.shape != (k, 3) or images.shape != (k, 2) or weights.shape != (k,):
            raise InputError(
                f"extra points {points.shape}, {images.shape} and weights {weights.shape}: "
                "wanted (k, 3), (k, 2) and (k,)"
            )
        if (weights < 0).any():
            raise InputError("extra points: a weight is negative")
        known = np.isfinite(np.column_stack([points, images, weights])).all(axis=1)
        return cls(points[known], images[known], weights[known])

    def offsets_px(self, pose: Pose, camera: Camera) -> Array:
        """Distances ``(k,)`` of the images under ``pose``; infinite behind the camera."""
        X = pose @ self.points_mm
        ahead = X[:, 2] > 0
        X = np.where(ahead[:, None], X, 1.0)
        off = np.linalg.norm(camera.project(X) - self.images_px, axis=1)
        return np.where(ahead, off, np.inf)


def reduce_matches(
    outline: Outline,
    seen_px: Array,
    edges: EdgePoints,
    matches: Matches,
    kind: Kind,
    floor_px: float,
    tangential: float,
) -> tuple[Pairs, Array, Array, float]:
    """Pairs of the matches with robust weights, those weights, the residuals, their scale."""
    images, normals = edges.points_px[matches.edge], edges.normals[matches.edge]
    residuals = np.sum((seen_px[matches.model] - images) * normals, axis=1)
    robust, scale = robust_weights(residuals, kind, floor_px)
    points = outline.points_mm[matches.model]
    return (
        Pairs.of(points, images, robust / scale**2, normals, tangential),
        robust,
        residuals,
        scale,
    )


def reduce_extra(extra: ExtraPoints, pose: Pose, camera: Camera, scale: float) -> Pairs:
    """Pairs of the extra points: Huber's weights, as a wrong fingertip must not take the palm."""
    off = extra.offsets_px(pose, camera)
    off = np.minimum(off, 1e6)  # behind the camera is as far as can be
    robust, _ = robust_weights(off, "huber", 2 * scale)
    normals = np.zeros((len(off), 2))
    return Pairs.of(
        extra.points_mm, extra.images_px, extra.weights * robust / scale**2, normals, 1.0
    )
