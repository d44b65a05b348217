"""What the method would get wrong: parts of the data base reconstructed from the rest.

The same held-out errors serve four ends: to rank markers greedily, to choose settings, to know how
the regression's errors go together (:mod:`handtrack.mocap.closing`), and to state an uncertainty
that holds: the deviations are multiplied so that 90 % of the held-out angles lie inside the 90 %
interval.

They also make a second round possible (ours). The angles of the hand that was closed on its markers
say more than the markers do: how two joints go together is nearly linear in angles, and in
millimetres it is not. So the angles are regressed once more, on those of the closed hand, held out
in the data base as they are in a query, and the hand is closed again.

>>> rng = np.random.default_rng(0)
>>> theta = np.repeat(rng.normal(0, 0.3, (80, 4)), 5, axis=1)
>>> X = (theta[:, :4, None] @ rng.normal(0, 30, (1, 3))) + rng.normal(0, 1, (80, 4, 3))
>>> held = held_out(Handover(), X, theta, np.arange(80) // 20)
>>> factor = held.factor(theta)
>>> inside = np.abs(held.theta - theta) <= NINETY * factor * held.std
>>> bool(abs(inside.mean() - 0.9) < 0.02)
True
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.mocap import closing, pca
from handtrack.mocap.borrowed import enlarged
from handtrack.mocap.closing import Closed, Forward
from handtrack.mocap.regression import predict
from handtrack.mocap.settings import Handover
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Half width of a 90 % interval of a normal distribution, in standard deviations.
NINETY = 1.6449
#: No angle of a regression is surer than this.
SURE_RAD = np.radians(0.3)
#: Parts in which borrowed poses are held out.
BORROWED_PARTS = 4


@dataclass(frozen=True, eq=False)
class Round:
    """A regression from what is known of a frame, and how it errs.

    Parameters
    ----------
    known : (N, M, D) what it regresses on: markers in mm, or angles in degrees.
    spread : (5, 4, 4) covariances of its held-out errors in each digit, in radians.
    mean_variance : (5,) what it stated for them.
    """

    known: Array
    spread: Array
    mean_variance: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of(cls, known: Array, off: Array, std: Array) -> "Round":
        """From held-out errors and stated deviations ``(n, 20)``."""
        each = off.reshape(len(off), 5, 4)
        spread = np.einsum("nda,ndb->dab", each, each) / len(off) + SURE_RAD**2 * np.eye(4)
        return cls(known, spread, _digit_variance(std).mean(axis=0))

    def close(
        self, forward: Forward, Q_mm: Array, theta: Array, std: Array, close_mm: float
    ) -> Closed:
        """Bring its hands ``(F, 20)`` to their markers, by how sure of each digit it was."""
        scale = _digit_variance(std) / np.maximum(self.mean_variance, 1e-12)
        return forward.close(Q_mm, theta, self.spread, close_mm, scale)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Angles of held-out frames, their stated deviations ``(N, 20)``, and the rounds behind them.

    ``angles`` ``(N', 20)`` are those of the data base, with the poses that it borrowed.
    """

    theta: Array
    std: Array
    angles: Array
    rounds: tuple[Round, ...]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def error(self, truth: Array) -> float:
        """Mean absolute error in radians."""
        return float(np.abs(self.theta - truth).mean())

    def factor(self, truth: Array) -> Array:
        """What to multiply stated deviations ``(20,)`` by, so that 90 % intervals hold 90 %."""
        off = np.abs(self.theta - truth) / np.maximum(self.std, 1e-9)
        return np.asarray(np.quantile(off, 0.9, axis=0) / NINETY)

    def closed(
        self, settings: Handover, forward: Forward, Q_mm: Array, theta: Array, std: Array
    ) -> Closed:
        """Hands of a query, regressed on its markers ``(F, M, 3)``, closed in all rounds."""
        got = self.rounds[0].close(forward, Q_mm, theta, std, settings.close_mm)
        for later in self.rounds[1:]:
            mean, std = _again(settings, later.known, self.angles, _features(got.theta))
            got = later.close(forward, Q_mm, mean, std, settings.close_mm)
        return got


def regressed(
    settings: Handover, X_mm: Array, theta: Array, Q_mm: ArrayLike
) -> tuple[Array, Array]:
    """Angles and deviations ``(F, 20)`` of queries, through the principal components."""
    space = pca.fit(theta)
    K = settings.components or len(space.variance)
    got = predict(settings.regression, X_mm, space.scores(theta)[:, :K], Q_mm)
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
    own = slice(len(theta))
    X, angles = enlarged(X_mm, theta, settings.borrow, n_markers)
    part = np.concatenate([fold, -1 - np.arange(len(X) - len(theta)) % BORROWED_PARTS])
    wanted = part if settings.rounds > 1 else fold  # a second round learns from borrowed poses too
    mean, std = _each_from_the_others(partial(regressed, settings), X, angles, part, wanted)
    rounds = [Round.of(X, (angles - mean)[own], std[own])]
    if settings.close_mm == 0:
        return HeldOut(mean[own], std[own], angles, tuple(rounds))
    now = X[:, : n_markers or None]
    got = _closed_apart(settings, rounds[0], now, mean, std, angles, part, wanted)
    for _ in range(settings.rounds - 1):
        known = _features(got.theta)
        mean, std = _each_from_the_others(partial(_again, settings), known, angles, part, wanted)
        rounds.append(Round.of(known, (angles - mean)[own], std[own]))
        got = _closed_apart(settings, rounds[-1], now, mean, std, angles, part, wanted)
    return HeldOut(got.theta[own], got.std[own], angles, tuple(rounds))


def _closed_apart(
    settings: Handover,
    regression: Round,
    now: Array,
    mean: Array,
    std: Array,
    angles: Array,
    part: NDArray[np.int64],
    wanted: NDArray[np.int64],
) -> Closed:
    """The ``wanted`` parts closed on their markers, whose places are learnt from the other parts.

    Borrowed poses are closed together: they have their markers where the data base puts them.
    """
    theta, deviation = np.full((2, *mean.shape), np.nan)
    clip = np.maximum(part, -1)
    for group in np.unique(np.maximum(wanted, -1)):
        held = clip == group
        others = ~held & (part >= 0)
        forward = closing.fit(now[others], angles[others])
        got = regression.close(forward, now[held], mean[held], std[held], settings.close_mm)
        theta[held], deviation[held] = got.theta, got.std
    return Closed(theta, deviation)


def _each_from_the_others(
    regress: Callable[[Array, Array, Array], tuple[Array, Array]],
    known: Array,
    angles: Array,
    part: NDArray[np.int64],
    wanted: NDArray[np.int64],
) -> tuple[Array, Array]:
    """Means and deviations ``(N, 20)``, every ``wanted`` part from all others; NaN elsewhere."""
    mean, std = np.full((2, *angles.shape), np.nan)
    for group in np.unique(wanted):
        held = part == group
        mean[held], std[held] = regress(known[~held], angles[~held], known[held])
    return mean, std


def _again(settings: Handover, known: Array, angles: Array, query: Array) -> tuple[Array, Array]:
    """Angles and deviations ``(F, 20)`` from the angles of closed hands."""
    got = predict(settings.regression, known, angles, query)
    return got.mean, got.std


def _features(theta: Array) -> Array:
    """Angles ``(F, 20, 1)`` in degrees, whose distances weigh as those of markers in mm do."""
    return np.asarray(np.degrees(theta)[:, :, None])


def _digit_variance(std: Array) -> Array:
    """Mean variance of each digit's angles ``(F, 5)``."""
    return np.asarray((std**2).reshape(len(std), 5, 4).mean(axis=-1))
