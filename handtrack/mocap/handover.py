"""The hand-over method: a few markers in, the whole hand out.

Per query frame the markers that are there are regressed to the principal components of the data
base's joint angles (:mod:`handtrack.mocap.regression`), the trajectories of the components are
smoothed by the cone filter, and the angles are ``theta = mean + V^T z``. If asked, the hand is then
brought to its markers (:mod:`handtrack.mocap.closing`) and smoothed once more. Components that are
left out stay at zero and add their variance to the stated uncertainty, which is calibrated on parts
of the data base that are held out (:mod:`handtrack.mocap.validation`).

>>> from handtrack.mocap.database import build, shipped_clip
>>> base = build([shipped_clip("girl", seed=0)])
>>> X = columns(base, base.labels, ("thumb_tip", "index_tip", "little_tip"))
>>> hand = reconstruct(base, X, X[:40], Handover())
>>> bool(np.abs(hand.theta[15:25] - base.theta[15:25]).max() < 0.05)
True
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.mocap import closing, pca
from handtrack.mocap.borrowed import enlarged
from handtrack.mocap.database import SAME_RATE, Database
from handtrack.mocap.markers import Markers
from handtrack.mocap.regression import predict
from handtrack.mocap.root import RootLink, find_root
from handtrack.mocap.settings import Handover
from handtrack.mocap.smoothing import cone
from handtrack.mocap.validation import angle_std, held_out
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: A root triangle larger or smaller than the data base's by this is a matter of units.
UNITS_FACTOR = 30.0
#: ... and by this, of another hand or another placement: refused too.
SIZE_FACTOR = 2.0
#: Frames of the data base that the uncertainty is calibrated on.
CALIBRATION_FRAMES = 600


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Angles and their deviations ``(F, 20)``, and the components ``(F, K)``; NaN: not known."""

    theta: Array
    std: Array
    scores: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)


def reconstruct(
    base: Database, X_mm: Array, Q_mm: Array, settings: Handover, starts: Sequence[int] = (0,)
) -> Reconstruction:
    """The hand of every query frame.

    Parameters
    ----------
    base : the data base.
    X_mm : (N, M, 3) its markers that the query has too (:func:`columns`).
    Q_mm : (F, M, 3) the query's, in the root's frame, NaN where missing.
    settings : of the method.
    starts : rows of the query at which clips begin.

    Raises
    ------
    InputError
        More components are asked for than there are.
    """
    space = pca.fit(base.theta)
    if settings.components > len(space.variance):
        raise InputError(
            f"{settings.components} components asked for; the angles have {len(space.variance)}"
        )
    K = settings.components or len(space.variance)
    step = max(round(settings.window_step_s * base.rate_hz), 1)
    X = windowed(X_mm, base.starts, settings.window, step)
    Q = windowed(Q_mm, np.asarray(starts), settings.window, step)
    larger, angles = enlarged(X, base.theta, settings.borrow, X_mm.shape[1])
    got = predict(settings.regression, larger, space.scores(angles)[:, :K], Q)
    bounds = [*starts, len(Q)]
    scores = np.concatenate(
        [cone(got.mean[a:b], base.rate_hz, settings.taps) for a, b in pairwise(bounds)]
    )
    theta, std = space.back(scores), angle_std(space, got.std)
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(Q).all(axis=-1))
    for pattern in np.unique(seen[seen.any(axis=1)], axis=0):
        rows = (seen == pattern).all(axis=1)
        theta[rows], std[rows] = _finished(
            base, X, Q[rows], theta[rows], std[rows], pattern, settings
        )
    if settings.close_mm > 0:  # frame by frame, so it may jump where two hands fit the markers
        smooth = [cone(theta[a:b], base.rate_hz, settings.taps) for a, b in pairwise(bounds)]
        theta = np.concatenate(smooth)
        scores = space.scores(theta)[:, :K]
    return Reconstruction(theta, std, scores)


def _finished(
    base: Database,
    X_mm: Array,
    Q_mm: Array,
    theta: Array,
    std: Array,
    pattern: NDArray[np.bool_],
    settings: Handover,
) -> tuple[Array, Array]:
    """Frames that show the same markers: brought to them if asked, with deviations that hold."""
    whole = np.isfinite(X_mm[:, pattern]).all(axis=(1, 2))
    usable = np.flatnonzero(whole)
    rows = usable[np.linspace(0, len(usable) - 1, min(CALIBRATION_FRAMES, len(usable))).astype(int)]
    fold = base.folds()[rows]
    if len(np.unique(fold)) < 2:
        return theta, std
    now = int(pattern[: X_mm.shape[1] // (1 + 2 * settings.window)].sum())
    truth = base.theta[rows]
    if now == 0:  # only neighbours in time are seen: nothing to close on
        settings = replace(settings, close_mm=0.0, rounds=1)
    held = held_out(settings, X_mm[rows][:, pattern], truth, fold, now)
    if settings.close_mm > 0:
        forward = closing.fit(X_mm[whole][:, pattern][:, :now], base.theta[whole])
        got = held.closed(settings, forward, Q_mm[:, pattern][:, :now], theta, std)
        theta, std = got.theta, got.std
    return theta, std * held.factor(truth)


def windowed(X_mm: Array, starts: NDArray[np.int64], window: int, step: int) -> Array:
    """Markers ``(F, M, 3)`` with those of the neighbouring frames behind them, within each clip."""
    if window == 0:
        return X_mm
    rows = np.arange(len(X_mm))
    clip = np.searchsorted(starts, rows, side="right") - 1
    first, last = starts[clip], np.append(starts[1:], len(X_mm))[clip] - 1
    shifts = [0, *(s * k * step for k in range(1, window + 1) for s in (-1, 1))]
    return np.concatenate([X_mm[np.clip(rows + shift, first, last)] for shift in shifts], axis=1)


def columns(base: Database, labels: Sequence[str], chosen: Sequence[str]) -> Array:
    """The chosen markers of the data base, ``(N, len(chosen), 3)``.

    Raises
    ------
    InputError
        A chosen marker is not in ``labels`` or not in the data base; both lists are named.
    """
    strangers = [m for m in chosen if m not in base.labels or m not in labels]
    if strangers or not chosen:
        raise InputError(
            f"markers {', '.join(strangers) or 'in common'} are not in both: "
            f"the query has {', '.join(labels)}; the data base has {', '.join(base.labels)}"
        )
    return base.X_mm[:, [base.labels.index(m) for m in chosen]]


def check_query(base: Database, query: Markers) -> None:
    """Refuse a query of another rate, of other units, or without the root.

    Raises
    ------
    InputError
        With the reason and the way out.
    """
    lacking = [m for m in base.root if m not in query.labels]
    if lacking:
        raise InputError(
            f"the query lacks the root marker {', '.join(lacking)}; three or more are needed, and "
            f"the data base has {', '.join(base.root)}; the query has {', '.join(query.labels)}"
        )
    if abs(query.rate_hz / base.rate_hz - 1) > SAME_RATE:
        raise InputError(
            f"the query has {query.rate_hz:.4g} Hz and the data base {base.rate_hz:.4g} Hz; "
            "--resample brings the query to the rate of the data base"
        )
    ratio = _size(query.select(base.root).positions_mm) / _size(base.reference_mm[None])
    if not 1 / UNITS_FACTOR < ratio < UNITS_FACTOR:
        raise InputError(
            f"the query's root markers are {ratio:.3g} times as far apart as the data base's: "
            f"is one in metres? (the query's file states {query.unit})"
        )
    if not 1 / SIZE_FACTOR < ratio < SIZE_FACTOR:
        raise InputError(
            f"the query's root markers are {ratio:.3g} times as far apart as the data base's: "
            "they are not in the same places on the hand"
        )


def _size(root_mm: Array) -> float:
    """Median distance of the root markers from their centre."""
    whole = root_mm[np.isfinite(root_mm).all(axis=(1, 2))]
    if len(whole) == 0:
        raise InputError("no frame of the query shows all root markers at once")
    spread = whole - whole.mean(axis=1, keepdims=True)
    return float(np.median(np.linalg.norm(spread, axis=-1)))


def in_root(base: Database, query: Markers, chosen: Sequence[str]) -> tuple[Array, RootLink]:
    """The chosen markers of a query ``(F, M, 3)`` in the root's frame, and where the root is."""
    link = find_root(query.select(base.root).positions_mm, base.reference_mm)
    return link.to_root(query.select(chosen).positions_mm), link


def check_side(base: Database, Q_mm: Array, chosen: Sequence[str]) -> None:
    """Refuse the other hand: its root markers fit when flipped, and put it behind their plane.

    Parameters
    ----------
    Q_mm : (F, M, 3) the chosen markers of the query in the root's frame.

    Raises
    ------
    InputError
        The markers lie where the data base's mirror image has them.
    """
    middle = base.reference_mm.mean(axis=0)
    normal = np.linalg.svd(base.reference_mm - middle)[2][2]
    X = columns(base, base.labels, chosen)
    usual, here = (np.nanmedian(P.reshape(-1, len(chosen), 3), axis=0) for P in (X, Q_mm))
    flipped = usual - 2 * ((usual - middle) @ normal)[:, None] * normal
    apart, apart_flipped = (np.nanmean(np.linalg.norm(here - P, axis=1)) for P in (usual, flipped))
    if apart_flipped < 0.5 * apart:
        raise InputError(
            f"the markers lie as the mirror image of the data base's {base.side} hand: "
            "is the query the other hand?"
        )
