"""Locally weighted regression from a few markers to whatever the full hand is described by.

For a query ``q`` every data base frame ``i`` weighs ``w_i = 1 / |q - x_i|`` (the paper's inverse
Euclidean distance), and a linear regression with these weights is evaluated at ``q``::

    minimise  sum_i w_i |y_i - B^T (1, x_i)|^2 + ridge |B|^2        y(q) = B^T (1, q)

Each query has its own normal equations ``A = sum w (1,x)(1,x)^T`` and ``C = sum w (1,x) y^T``.
Both are linear in the weights, so with the products ``(1,x)(1,x)^T, (1,x) y^T, y^2`` of every data
base frame laid out as the columns of one matrix ``P``, all queries are **one matrix product**
``W P``, and what is left is a small solve each. With a limit on the neighbours the products are
formed for those only.

- A query at a data base frame has an infinite weight: the answer is that frame (their mean).
- Marker coordinates are turned to their principal axes and scaled; axes along which nothing moves
  are dropped, which is what the minimum-norm solution does.
- Markers missing from a query are left out of its regression: queries are grouped by what they
  show. The residual of the fit, hence the stated uncertainty, grows by itself.

The uncertainty is that of a prediction, ``s^2 (1 + h)``, with ``s^2`` the weighted residual
variance, corrected for the degrees of freedom of the fit, and ``h`` the leverage of the query;
``n = (sum w)^2 / sum w^2`` frames count.

>>> x = np.array([[[0.0, 0, 0]], [[1, 0, 0]], [[2, 0, 0]], [[3, 1, 0]], [[4, 0, 1]]])
>>> y = 2 * x[:, 0, :1] + 1
>>> predict(Regression(), x, y, [[[2.5, 0.0, 0.0]]]).mean.round(6).tolist()
[[6.0]]
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist

from handtrack.errors import InputError
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Closer than this a query *is* the data base frame.
SAME_MM = 1e-6
#: Directions whose standard deviation is below this carry no information.
STILL_MM = 1e-4
_QUERIES, _FRAMES = 64, 4096  # rows of W and of P at a time: bounds the memory
_JITTER = 1e-13


@dataclass(frozen=True)
class Regression:
    """Settings; the defaults are the paper's."""

    neighbours: int = 0
    """Only so many nearest data base frames vote; 0 lets all."""
    ridge_mm: float = 0.0
    """Noise of a marker coordinate, in mm, that the regression is damped for."""
    power: float = 1.0
    """Weights are the inverse distance to this power."""

    def __post_init__(self) -> None:
        if self.neighbours < 0 or self.ridge_mm < 0 or self.power < 0:
            raise InputError("neighbours, ridge and power of the regression must not be negative")


@dataclass(frozen=True, eq=False)
class Prediction:
    """Means and standard deviations ``(F, K)``, NaN where no marker was seen."""

    mean: Array
    std: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)


def predict(settings: Regression, X_mm: ArrayLike, Y: ArrayLike, Q_mm: ArrayLike) -> Prediction:
    """Predict ``Y`` at the queries.

    Parameters
    ----------
    X_mm : (N, M, 3) markers of the data base, NaN where missing.
    Y : (N, K) what they go with.
    Q_mm : (F, M, 3) markers of the queries, NaN where missing.

    Raises
    ------
    InputError
        No data base frame shows the markers that a query shows.
    """
    X, y, Q = np.asarray(X_mm, float), np.asarray(Y, float), np.asarray(Q_mm, float)
    mean, std = np.full((2, len(Q), y.shape[1]), np.nan)
    seen = np.isfinite(Q).all(axis=-1)
    whole = np.isfinite(X).all(axis=-1)
    patterns, group = np.unique(seen, axis=0, return_inverse=True)
    for g, pattern in enumerate(patterns):
        if not pattern.any():
            continue
        rows = np.flatnonzero(group.ravel() == g)
        base = whole[:, pattern].all(axis=1)
        if not base.any():
            raise InputError(
                "no frame of the data base shows all of the markers that a query frame shows"
            )
        flat = X[base][:, pattern].reshape(int(base.sum()), -1)
        queries = Q[rows][:, pattern].reshape(len(rows), -1)
        mean[rows], std[rows] = _predict_whole(settings, flat, y[base], queries)
    return Prediction(mean, std)


def _predict_whole(s: Regression, X: Array, Y: Array, Q: Array) -> tuple[Array, Array]:
    """Means and deviations ``(F, K)`` of queries ``(F, D)`` that miss nothing."""
    axes, scale, centre = _axes(X)
    Z = (X - centre) @ axes / scale
    ridge = (s.ridge_mm / scale) ** 2
    y0 = Y.mean(axis=0)
    mean, std = np.empty((2, len(Q), Y.shape[1]))
    limit = 0 if s.neighbours >= len(X) else s.neighbours
    products = None if limit else _Products(Z, Y - y0)
    for first in range(0, len(Q), _QUERIES):
        rows = slice(first, first + _QUERIES)
        q = (Q[rows] - centre) @ axes / scale
        distance = cdist(Q[rows], X)
        W = np.maximum(distance, SAME_MM)
        np.divide(1.0, W, out=W)
        if s.power != 1:
            W **= s.power
        if products is None:
            A, C, yy, square = _nearest(distance, W, Z, Y - y0, limit)
        else:
            A, C, yy = products.sums(W)
            square = np.einsum("fn,fn->f", W, W)
        mean[rows], std[rows] = _solve(A, C, yy, square, q, ridge)
        for k in np.flatnonzero(distance.min(axis=1) < SAME_MM):
            mean[first + k] = Y[distance[k] < SAME_MM].mean(axis=0) - y0
    return mean + y0, std


def _axes(X: Array) -> tuple[Array, Array, Array]:
    """Principal axes ``(D, d)`` along which the markers move, their deviations, the centre."""
    centre = X.mean(axis=0)
    variance, axes = np.linalg.eigh((X - centre).T @ (X - centre) / len(X))
    moving = variance > max(STILL_MM**2, 1e-14 * variance[-1])
    return axes[:, moving], np.sqrt(variance[moving]), centre


class _Products:
    """The products of every data base frame, a block of frames at a time."""

    def __init__(self, Z: Array, Y: Array) -> None:
        self.d, self.K = Z.shape[1] + 1, Y.shape[1]
        self.i, self.j = np.triu_indices(self.d)
        self.Z1, self.Y = np.column_stack([np.ones(len(Z)), Z]), Y
        small = len(Z) <= 8 * _FRAMES
        self.kept = [self._block(f) for f in range(0, len(Z), _FRAMES)] if small else []

    def _block(self, first: int) -> Array:
        z, y = self.Z1[first : first + _FRAMES], self.Y[first : first + _FRAMES]
        crossed = (z[:, :, None] * y[:, None, :]).reshape(len(z), -1)
        return np.hstack([z[:, self.i] * z[:, self.j], crossed, y * y])

    def sums(self, W: Array) -> tuple[Array, Array, Array]:
        """``A`` ``(F, d, d)``, ``C`` ``(F, d, K)`` and ``sum w y^2`` ``(F, K)``."""
        total = np.zeros((len(W), len(self.i) + self.d * self.K + self.K))
        for b, first in enumerate(range(0, len(self.Z1), _FRAMES)):
            P = self.kept[b] if self.kept else self._block(first)
            total += W[:, first : first + _FRAMES] @ P
        n = len(self.i)
        A = np.empty((len(W), self.d, self.d))
        A[:, self.i, self.j] = A[:, self.j, self.i] = total[:, :n]
        return A, total[:, n : -self.K].reshape(-1, self.d, self.K), total[:, -self.K :]


def _nearest(
    distance: Array, W: Array, Z: Array, Y: Array, k: int
) -> tuple[Array, Array, Array, Array]:
    """The same sums, over the ``k`` nearest frames of each query, and ``sum w^2`` ``(F,)``."""
    near = np.argpartition(distance, k - 1, axis=1)[:, :k]
    w = np.take_along_axis(W, near, axis=1)[:, :, None]
    z = np.concatenate([np.ones((*near.shape, 1)), Z[near]], axis=2)
    y = Y[near]
    weighted = (z * w).transpose(0, 2, 1)
    return weighted @ z, weighted @ y, (w * y * y).sum(axis=1), (w * w).sum(axis=(1, 2))


def _solve(
    A: Array, C: Array, yy: Array, square: Array, q: Array, ridge: Array
) -> tuple[Array, Array]:
    """Evaluate the regressions at ``q`` ``(F, d - 1)``: means and deviations ``(F, K)``."""
    total = A[:, 0, 0].copy()
    d = A.shape[1]
    damped = A / total[:, None, None]
    damped[:, range(1, d), range(1, d)] += ridge
    damped[:, range(d), range(d)] += _JITTER * np.trace(damped, axis1=1, axis2=2)[:, None]
    q1 = np.column_stack([np.ones(len(q)), q])
    solved = np.linalg.solve(damped, np.concatenate([C / total[:, None, None], q1[..., None]], 2))
    B, lever = solved[..., :-1], np.einsum("fd,fd->f", q1, solved[..., -1])
    mean = np.einsum("fd,fdk->fk", q1, B)
    fitted = np.einsum("fdk,fde,fek->fk", B, A, B, optimize=True)
    variance = (yy - 2 * np.einsum("fdk,fdk->fk", B, C) + fitted) / total[:, None]
    n_effective = total**2 / square
    spent = n_effective / np.maximum(n_effective - d, 1.0)  # degrees of freedom of the fit
    widening = (1 + np.maximum(lever, 0) / n_effective) * spent
    return mean, np.sqrt(np.maximum(variance, 0.0) * widening[:, None])
