"""What the method would get wrong: parts of the data base reconstructed from the rest.

The same held-out errors serve four ends: to rank markers greedily, to choose settings, to know how
the regression's errors go together (:mod:`handtrack.mocap.closing`), and to state an uncertainty
that holds: the deviations are multiplied so that 90 % of the held-out angles lie inside the 90 %
interval.

>>> rng = np.random.default_rng(0)
>>> theta = np.repeat(rng.normal(0, 0.3, (80, 4)), 5, axis=1)
>>> X = (theta[:, :4, None] @ rng.normal(0, 30, (1, 3))) + rng.normal(0, 1, (80, 4, 3))
>>> held = held_out(Handover(), X, theta, np.arange(80) // 20)
>>> factor = held.factor(theta)
>>> inside = np.abs(held.theta - theta) <= NINETY * factor * held.std
>>> bool(abs(inside.mean() - 0.9) < 0.02)
True
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.mocap import closing, pca
from handtrack.mocap.borrowed import enlarged
from handtrack.mocap.regression import predict
from handtrack.mocap.settings import Handover
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Half width of a 90 % interval of a normal distribution, in standard deviations.
NINETY = 1.6449
#: No angle of a regression is surer than this.
SURE_RAD = np.radians(0.3)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Angles of held-out frames and their stated deviations ``(N, 20)``.

    ``spread`` ``(5, 4, 4)`` are the covariances of the regression's errors in each digit (before
    the hand closes on its markers), and ``mean_variance`` ``(5,)`` what it stated for them.
    """

    theta: Array
    std: Array
    spread: Array
    mean_variance: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def error(self, truth: Array) -> float:
        """Mean absolute error in radians."""
        return float(np.abs(self.theta - truth).mean())

    def factor(self, truth: Array) -> Array:
        """What to multiply stated deviations ``(20,)`` by, so that 90 % intervals hold 90 %."""
        off = np.abs(self.theta - truth) / np.maximum(self.std, 1e-9)
        return np.asarray(np.quantile(off, 0.9, axis=0) / NINETY)

    def scale(self, std: Array) -> Array:
        """How much surer or less sure ``(F, 5)`` than usual the regression is in each frame."""
        return digit_variance(std) / np.maximum(self.mean_variance, 1e-12)


def digit_variance(std: Array) -> Array:
    """Mean variance of each digit's angles ``(F, 5)``."""
    return np.asarray((std**2).reshape(len(std), 5, 4).mean(axis=-1))


def regressed(
    settings: Handover, X_mm: Array, theta: Array, Q_mm: ArrayLike, n_markers: int = 0
) -> tuple[Array, Array]:
    """Angles and deviations ``(F, 20)`` of queries, through the principal components."""
    space = pca.fit(theta)
    K = settings.components or len(space.variance)
    X, angles = enlarged(X_mm, theta, settings.borrow, n_markers)
    got = predict(settings.regression, X, space.scores(angles)[:, :K], Q_mm)
    return space.back(got.mean), angle_std(space, got.std)


def angle_std(space: pca.Pca, score_std: Array) -> Array:
    """Deviations of the angles ``(F, 20)`` from those of the first components ``(F, K)``."""
    K, V = score_std.shape[1], space.components
    return np.asarray(np.sqrt(score_std**2 @ V[:K] ** 2 + space.variance[K:] @ V[K:] ** 2))


def held_out(
    settings: Handover, X_mm: Array, theta: Array, fold: NDArray[np.int64], n_markers: int = 0
) -> HeldOut:
    """Reconstruct every part of the data base from the others.

    Parameters
    ----------
    settings : of the method; smoothing is left out.
    X_mm : (N, M, 3) markers, nothing missing.
    theta : (N, 20) angles.
    fold : (N,) the part that each frame belongs to; two parts or more.
    n_markers : the first so many markers are of the frame itself, the others of its neighbours in
        time; 0: all are.
    """
    mean, std = np.empty((2, *theta.shape))
    parts = [fold == group for group in np.unique(fold)]
    for held in parts:
        mean[held], std[held] = regressed(
            settings, X_mm[~held], theta[~held], X_mm[held], n_markers
        )
    off = (theta - mean).reshape(len(theta), 5, 4)
    spread = np.einsum("nda,ndb->dab", off, off) / len(off) + SURE_RAD**2 * np.eye(4)
    before = HeldOut(mean, std, spread, digit_variance(std).mean(axis=0))
    if settings.close_mm == 0:
        return before
    now = X_mm[:, : n_markers or None]
    scale = before.scale(std)
    mean, std = mean.copy(), std.copy()
    for held in parts:
        forward = closing.fit(now[~held], theta[~held])
        got = forward.close(now[held], mean[held], spread, settings.close_mm, scale[held])
        mean[held], std[held] = got.theta, got.std
    return HeldOut(mean, std, spread, before.mean_variance)
