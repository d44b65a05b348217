"""The lines between basis states, and the one nearest to a configuration (paper, Section 4.1).

For a configuration ``X`` and the line from ``B_i`` to ``B_j``::

    s = (X - B_i) . (B_j - B_i) / |B_j - B_i|^2        (4), with the norm squared
    foot = B_i + s (B_j - B_i)                         (5), s clipped to 0..1

(the paper prints (4) without the square, which does not agree with (5)). The nearest line is the
one whose foot is nearest.

>>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
>>> nearest = nearest_line([[0.25, -0.5]], corners)
>>> nearest.pair.tolist(), nearest.s.tolist(), nearest.distance.tolist()
([[0, 1]], [0.25], [0.5])
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class NearestLine(NamedTuple):
    """The line nearest to each of ``n`` configurations."""

    pair: NDArray[np.int64]  # (n, 2) basis states i < j
    s: Array  # (n,) place on the line, 0 at i, 1 at j
    foot: Array  # (n, k)
    distance: Array  # (n,) in radians


def nearest_line(X: ArrayLike, basis_X: Array) -> NearestLine:
    """For each of ``X`` ``(n, k)`` the nearest line between two of the states ``(m, k)``.

    At a basis state all lines through it are equally near; the first of them is named.
    """
    points = np.ascontiguousarray(X, dtype=float)
    n = len(points)
    pair, place, distance = np.empty((n, 2), np.int64), np.empty(n), np.empty(n)
    nearest_line_kernel(points, basis_X, pair, place, distance)
    start, end = basis_X[pair[:, 0]], basis_X[pair[:, 1]]
    return NearestLine(pair, place, start + place[:, None] * (end - start), distance)


@numba.njit(cache=True)
def nearest_line_kernel(X, B, pair, place, distance):  # type: ignore[no-untyped-def]
    """Fill ``pair`` ``(n, 2)``, ``place`` ``(n,)``, ``distance`` ``(n,)``: ``X`` ``(n, k)``.

    With ``q_i = |X - B_i|^2`` and ``L = |B_j - B_i|^2``, the dot product in (4) is
    ``p = (q_i + L - q_j) / 2`` and the squared distance of the foot ``q_i + s (s L - 2 p)``, so
    that a line costs a few operations, whatever ``k`` is.
    """
    m = len(B)
    squared = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            squared[i, j] = ((B[j] - B[i]) ** 2).sum()
    inverse = 1.0 / np.maximum(squared, 1e-300)
    q = np.empty(m)
    for n in range(len(X)):
        for i in range(m):
            q[i] = 0.0
            for c in range(B.shape[1]):
                q[i] += (X[n, c] - B[i, c]) ** 2
        best = np.inf
        for i in range(m - 1):
            for j in range(i + 1, m):
                L = squared[i, j]
                p = 0.5 * (q[i] + L - q[j])
                s = min(max(p * inverse[i, j], 0.0), 1.0)
                gap = q[i] + s * (s * L - 2.0 * p)
                if gap < best:
                    best = gap
                    pair[n, 0], pair[n, 1] = i, j
                    place[n] = s
        distance[n] = np.sqrt(max(best, 0.0))
