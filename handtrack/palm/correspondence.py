"""Which edge point belongs to which point of the outline: one to one, and facing the same way.

The nearest edge alone lets correspondences drift: several outline points share one edge point,
and a finger's edge takes the palm's. So a pair must be nearer than a gate, its normals within an
angle, and no edge point serves twice: of two claimants the nearer wins and the other takes its
next choice (the deferred acceptance of Gale and Shapley; as distances are mutual, it is the same
as taking all pairs from the nearest to the farthest). The gate shrinks from round to round.

>>> import numpy as np
>>> edges = EdgePoints(np.array([[0.0, 0], [4, 0], [9, 9]]), np.array([[0.0, 1], [0, 1], [1, 0]]))
>>> outline, up = np.array([[1.0, 0], [1.5, 0], [9, 8]]), np.array([[0.0, 1], [0, 1], [0, 1]])
>>> matches = correspond(outline, up, edges, gate_px=5.0)
>>> matches.model.tolist(), matches.edge.tolist()
([0, 1], [0, 1])
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class EdgePoints:
    """Edge points ``(m, 2)`` and unit normals ``(m, 2)`` of an image, sorted by x for search.

    Points or normals that are not finite are left out. ``original`` ``(m,)`` are the rows as
    they came.
    """

    def __init__(self, points_px: ArrayLike, normals: ArrayLike) -> None:
        points, n = np.asarray(points_px, float), np.asarray(normals, float)
        if points.ndim != 2 or points.shape[1:] != (2,) or points.shape != n.shape:
            raise InputError(f"edge points {points.shape} and normals {n.shape}: wanted (m, 2)")
        known = np.flatnonzero(np.isfinite(points).all(axis=1) & np.isfinite(n).all(axis=1))
        self.original: Indices = known[np.argsort(points[known, 0], kind="stable")]
        self.points_px: Array = np.ascontiguousarray(points[self.original])
        self.normals: Array = np.ascontiguousarray(n[self.original])
        for array in (self.original, self.points_px, self.normals):
            array.setflags(write=False)


class Matches(NamedTuple):
    """Pairs of outline rows and rows of the sorted edge points, in the outline's order."""

    model: Indices  # (p,)
    edge: Indices  # (p,)


def correspond(
    outline_px: Array,
    normals: Array,
    edges: EdgePoints,
    gate_px: float,
    angle_rad: float = np.radians(40.0),
    signed: bool = False,
) -> Matches:
    """Match the projected outline ``(n, 2)`` with its image normals ``(n, 2)`` to edge points.

    Parameters
    ----------
    gate_px : float
        Pairs farther apart are rejected.
    angle_rad : float
        Pairs whose normals differ by more are rejected.
    signed : bool
        Whether the edges' normals point out of the hand, so that a reversed one is another edge.
    """
    pairs = _match(
        outline_px,
        normals,
        edges.points_px,
        edges.normals,
        float(gate_px),
        float(np.cos(angle_rad)),
        signed,
    )
    model = np.flatnonzero(pairs >= 0)
    return Matches(model, pairs[model])


@numba.njit(cache=True)
def _match(q, normals, points, point_normals, gate, cos_limit, signed):  # type: ignore[no-untyped-def]
    """Edge rows ``(n,)`` of outline rows, -1 for none; ``points`` are sorted by x."""
    n, m = len(q), len(points)
    chosen = np.full(n, -1, np.int64)
    owner = np.full(m, -1, np.int64)
    best = np.full(m, gate * gate)  # what a claimant must beat
    waiting = np.empty(n, np.int64)
    for i in range(n):
        waiting[i] = n - 1 - i
    left = n
    while left > 0:
        left -= 1
        i = waiting[left]
        nearest, edge = gate * gate, -1
        x, y = q[i]
        if not (np.isfinite(x) and np.isfinite(y)):
            continue
        first = np.searchsorted(points[:, 0], x - gate)
        for j in range(first, m):
            dx = points[j, 0] - x
            if dx > gate:
                break
            dy = points[j, 1] - y
            d2 = dx * dx + dy * dy
            if d2 >= nearest or d2 >= best[j]:
                continue
            cosine = normals[i, 0] * point_normals[j, 0] + normals[i, 1] * point_normals[j, 1]
            if (cosine if signed else abs(cosine)) >= cos_limit:
                nearest, edge = d2, j
        if edge < 0:
            continue
        if owner[edge] >= 0:  # the former owner is farther and looks again
            chosen[owner[edge]] = -1
            waiting[left] = owner[edge]
            left += 1
        owner[edge], best[edge], chosen[i] = i, nearest, edge
    return chosen
