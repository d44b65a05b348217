"""The reconstructed hand closes on its markers.

A regression averages: the hand it gives need not have its markers where they were seen. But the
data base also tells where a digit's markers are for given angles. With the flexion, abduction and
two flexions ``t_1 .. t_4`` of a digit, a marker glued to one of its bones is linear in the products

    f(t) = u_1(t_1) u_2(t_2) u_3(t_3) u_4(t_4),    u_k one of 1, cos t_k, sin t_k

whatever the digit's lengths and axes (each rotation is linear in cosine and sine of its angle), so
81 coefficients a coordinate are fitted by least squares, ``x(t) = W^T f(t)``. The regression
``t_0``, whose errors have the covariance ``S``, is then moved to the minimum of

    |q - x(t)|^2 / s^2 + (t - t_0)^T S^-1 (t - t_0)

by Gauss-Newton: what the markers ``q`` fix is met to about ``s`` mm, what they leave open stays
where the regression has it, moved along as the angles usually err together. ``s^2`` is the square
of the asked nearness plus the mean square by which the fit misses the marker.

Which digit a marker belongs to is measured: the one whose angles explain it best.

>>> rng = np.random.default_rng(0)
>>> theta = rng.uniform(0, 1, (900, 20))
>>> tip = np.cumsum(np.cos(np.cumsum(theta[:, [4, 6, 7]], axis=1)) * [45, 25, 20], axis=1)[:, -1]
>>> X = np.stack([tip, 90 * np.sin(theta[:, 5]), 0 * tip], axis=-1)[:, None]
>>> forward = fit(X, theta)
>>> forward.digit.tolist()
[1]
>>> start = theta + rng.normal(0, 0.05, theta.shape)
>>> got = forward.close(X, start, np.tile(np.eye(4), (5, 1, 1)) * 0.05**2, 0.1)
>>> bool(np.abs(got.theta - theta)[:, 4:8].mean() < 0.75 * np.abs(start - theta)[:, 4:8].mean())
True
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

DIGITS, BENDS = 5, 4  # digits of a hand, angles of a digit
#: Damping of the fit, relative to the functions' mean square.
RIDGE = 1e-6
#: Frames of the data base that the fit uses at most, evenly spaced.
FRAMES = 4000
#: Gauss-Newton steps, and the longest one for an angle.
STEPS, LONGEST_RAD = 6, 0.3
#: Steps shorter than this, in every frame, change nothing.
ENOUGH_RAD = 1e-4
_ROWS = 1000  # frames at a time: bounds the memory


@dataclass(frozen=True, eq=False)
class Closed:
    """Angles and their deviations ``(F, 20)`` in radians."""

    theta: Array
    std: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, eq=False)
class Forward:
    """Where markers are for given angles.

    Parameters
    ----------
    digit : (M,) the digit that each marker sits on, thumb to little.
    weights : (M, 81, 3) coefficients, in mm.
    miss_mm : (M,) root mean square by which the fit misses a coordinate.
    """

    digit: NDArray[np.int64]
    weights: Array
    miss_mm: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def places(self, theta: ArrayLike) -> Array:
        """The markers ``(F, M, 3)`` of hands ``(F, 20)``, in mm."""
        angles = np.asarray(theta, float).reshape(-1, DIGITS, BENDS)
        each = [products(angles[:, d]) @ W for d, W in zip(self.digit, self.weights, strict=True)]
        return np.stack(each, axis=1)

    def close(
        self,
        Q_mm: ArrayLike,
        theta: ArrayLike,
        spread: ArrayLike,
        close_mm: float,
        scale: ArrayLike = 1.0,
    ) -> Closed:
        """Bring hands to their markers.

        Parameters
        ----------
        Q_mm : (F, M, 3) markers, NaN where not seen.
        theta : (F, 20) where to start, in radians.
        spread : (5, 4, 4) covariances of the start's errors in each digit.
        close_mm : how near to bring them.
        scale : (F, 5) or less, what to multiply the covariances by in each frame.
        """
        Q, start = np.asarray(Q_mm, float), np.asarray(theta, float)
        times = np.broadcast_to(scale, (len(Q), DIGITS))
        found, variance = start.copy(), np.empty_like(start)
        for d in range(DIGITS):
            columns = slice(BENDS * d, BENDS * (d + 1))
            mine = self.digit == d
            S = np.asarray(spread, float)[d]
            for first in range(0, len(Q), _ROWS):
                rows = slice(first, first + _ROWS)
                t, covariance = self._digit(
                    mine, Q[rows][:, mine], start[rows, columns], S, close_mm, times[rows, d]
                )
                found[rows, columns] = t
                variance[rows, columns] = np.diagonal(covariance, axis1=1, axis2=2)
        return Closed(found, np.sqrt(variance))

    def _digit(
        self, mine: NDArray[np.bool_], q: Array, t0: Array, S: Array, close_mm: float, times: Array
    ) -> tuple[Array, Array]:
        """Angles ``(F, 4)`` of one digit, and their covariances ``(F, 4, 4)``."""
        if not mine.any():
            return t0, S * times[:, None, None]
        prior = np.linalg.inv(S) / times[:, None, None]
        W = self.weights[mine].transpose(1, 0, 2).reshape(len(self.weights[0]), -1)
        seen = np.isfinite(q).all(axis=-1, keepdims=True)
        per_mm = np.where(seen, 1 / np.hypot(close_mm, self.miss_mm[mine])[:, None], 0.0)
        per_mm = np.broadcast_to(per_mm, q.shape).reshape(len(q), -1)
        target = np.where(seen, q, 0.0).reshape(len(q), -1)
        t = t0.copy()
        for _ in range(STEPS):
            f, slope = functions(t)
            J = np.moveaxis(slope @ W, 0, -1) * per_mm[:, :, None]
            H = J.transpose(0, 2, 1) @ J + prior
            off = (target - f @ W) * per_mm
            pull = J.transpose(0, 2, 1) @ off[..., None] - prior @ (t - t0)[..., None]
            step = np.linalg.solve(H, pull)[..., 0]
            t += np.clip(step, -LONGEST_RAD, LONGEST_RAD)
            if np.abs(step).max() < ENOUGH_RAD:
                break
        return t, np.linalg.inv(H)


def functions(t: Array) -> tuple[Array, Array]:
    """The 81 products of a digit's angles ``(F, 4)``, and their derivatives ``(4, F, 81)``."""
    one, cos, sin = np.ones_like(t), np.cos(t), np.sin(t)
    u = np.stack([one, cos, sin], axis=-1)  # (F, 4, 3)
    du = np.stack([0 * one, -sin, cos], axis=-1)
    first, second = _outer(u[:, 0], u[:, 1]), _outer(u[:, 2], u[:, 3])
    slopes = [
        _outer(_outer(du[:, 0], u[:, 1]), second),
        _outer(_outer(u[:, 0], du[:, 1]), second),
        _outer(first, _outer(du[:, 2], u[:, 3])),
        _outer(first, _outer(u[:, 2], du[:, 3])),
    ]
    return _outer(first, second), np.array(slopes)


def products(t: Array) -> Array:
    """The first of :func:`functions` alone."""
    u = np.stack([np.ones_like(t), np.cos(t), np.sin(t)], axis=-1)
    return _outer(_outer(u[:, 0], u[:, 1]), _outer(u[:, 2], u[:, 3]))


def _outer(a: Array, b: Array) -> Array:
    return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))


def fit(X_mm: ArrayLike, theta: ArrayLike) -> Forward:
    """Fit the markers ``(N, M, 3)`` of a data base to its angles ``(N, 20)``, nothing missing."""
    X, angles = np.asarray(X_mm, float), np.asarray(theta, float)
    rows = np.linspace(0, len(X) - 1, min(FRAMES, len(X))).round().astype(int)
    X, angles = X[rows], angles[rows]
    flat = X.reshape(len(X), -1)
    miss = np.empty((DIGITS, X.shape[1]))
    weights = []
    for d in range(DIGITS):
        f = products(angles[:, BENDS * d : BENDS * (d + 1)])
        W = np.linalg.solve(f.T @ f / len(f) + RIDGE * np.eye(f.shape[1]), f.T @ flat / len(f))
        miss[d] = np.sqrt(((flat - f @ W).reshape(X.shape) ** 2).mean(axis=(0, 2)))
        weights.append(W.reshape(-1, *X.shape[1:]).transpose(1, 0, 2))
    digit = miss.argmin(axis=0)
    every = np.arange(X.shape[1])
    return Forward(digit, np.array(weights)[digit, every], miss[digit, every])
