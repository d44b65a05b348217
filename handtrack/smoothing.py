"""Filters over a trajectory as plain functions: bridge short gaps, smooth, resample, differentiate.

All work on the frames' own time stamps, so a variable frame rate is no special case, and none
carries a delay: kernels are centred. What is not known stays not known, but for gaps that are
asked to be bridged.

The smoother is a local mean with a triangular (cone) kernel of full width ``w``,
``k(t) = max(0, 1 - 2|t| / w)``; turns are averaged as unit quaternions of aligned sign.

>>> import numpy as np
>>> t = np.arange(5.0)
>>> smooth_values(t, np.array([0.0, 0.0, 4.0, 0.0, 0.0])[:, None], 4.0)[:, 0].tolist()
[0.0, 1.0, 2.0, 1.0, 0.0]
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.records import Status
from handtrack.rotation import slerp
from handtrack.trajectory import FRAME_SHAPES, Trajectory

Array = NDArray[np.float64]

#: Fields that are averaged and interpolated as numbers; turns go by their quaternion.
_NUMBERS = ("palm_mm", "theta", "keypoints_px", "keypoints_mm")


def smooth(hand: Trajectory, width_s: float) -> Trajectory:
    """Angles, pose and keypoints averaged with a centred cone of full width ``width_s``."""
    smoothed: dict[str, Any] = {
        k: smooth_values(hand.time_s, getattr(hand, k), width_s) for k in _NUMBERS
    }
    q = smooth_values(hand.time_s, _aligned(hand.palm_wxyz), width_s)
    smoothed["palm_wxyz"] = _unit(q)
    return _noted(replace(hand, **smoothed), f"smooth {width_s:g} s")


def smooth_values(time_s: Array, values: Array, width_s: float) -> Array:
    """Centred cone average of ``values`` ``(F, ...)`` at ``time_s`` ``(F,)``; NaN is left out.

    Raises
    ------
    InputError
        The width is not positive, or time does not increase.
    """
    if not width_s > 0:
        raise InputError(f"a smoothing width of {width_s} s is not positive")
    _check_increasing(time_s)
    flat = values.reshape(len(values), -1)
    first = np.searchsorted(time_s, time_s - width_s / 2, "left")
    last = np.searchsorted(time_s, time_s + width_s / 2, "right")
    out = np.full_like(flat, np.nan)
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        weight = np.maximum(0, 1 - 2 * np.abs(time_s[a:b] - time_s[k]) / width_s)
        known = np.isfinite(flat[a:b])
        here = np.isfinite(flat[k])
        total = weight @ known
        out[k, here] = (weight @ np.where(known, flat[a:b], 0.0))[here] / total[here]
    return out.reshape(values.shape)


def bridge_gaps(hand: Trajectory, longest_s: float) -> Trajectory:
    """Fill gaps of at most ``longest_s`` between known frames; they become ``predicted``.

    Their uncertainty stays unknown. A gap at either end has no second side and stays.
    """
    both = np.column_stack([hand.theta, hand.palm_wxyz])
    known = np.asarray(np.isfinite(both).all(axis=1))
    at = np.flatnonzero(known)
    fill = np.zeros(len(hand), bool)
    for a, b in pairwise(at.tolist()):
        if b - a > 1 and hand.time_s[b] - hand.time_s[a] <= longest_s:
            fill[a + 1 : b] = True
    if not fill.any():
        return hand
    between = _interpolate(hand[known], hand.time_s[fill])
    columns = {k: getattr(hand, k).copy() for k in (*_NUMBERS, "palm_wxyz", "side")}
    for name, values in columns.items():
        values[fill] = between[name]
    status = hand.status.astype("<U11")
    status[fill] = Status.PREDICTED.value
    return _noted(replace(hand, **columns, status=status), f"bridge gaps up to {longest_s:g} s")


def resample(hand: Trajectory, rate_hz: float) -> Trajectory:
    """The known parts at a constant rate, from the first time stamp to the last.

    A new frame between two frames that are both known is interpolated; it has the status of the
    worse of the two. ``frame`` counts the new frames. Numbers go in straight lines, the palm's turn
    along the shortest arc; so the bones of a keypoint skeleton shorten a little in between, and the
    20 angles with the palm's pose say more exactly where a hand is.

    Raises
    ------
    InputError
        The rate is not positive, or time does not increase.
    """
    if not rate_hz > 0:
        raise InputError(f"a rate of {rate_hz} frames a second is not positive")
    _check_increasing(hand.time_s)
    n = int(np.floor((hand.time_s[-1] - hand.time_s[0]) * rate_hz + 1e-6)) + 1 if len(hand) else 0
    time_s = hand.time_s[:1].repeat(n) + np.arange(n) / rate_hz
    before = np.clip(np.searchsorted(hand.time_s, time_s + 1e-9, "right") - 1, 0, None)
    after = np.minimum(before + (time_s > hand.time_s[before] + 1e-9), len(hand) - 1)
    order = [status.value for status in Status]
    rank = np.array([order.index(s) for s in hand.status.tolist()], int)
    worse = np.where(rank[after] > rank[before], after, before)
    columns = {k: getattr(hand, k)[worse] for k in FRAME_SHAPES} | _interpolate(hand, time_s)
    columns["status"] = hand.status[worse]
    return _noted(
        replace(hand, **columns | {"frame": np.arange(n), "time_s": time_s}),
        f"resample to {rate_hz:g} Hz",
    )


def joint_velocity(hand: Trajectory) -> Array:
    """Angular velocities ``(F, 20)`` in rad/s by central differences at the frames' own times.

    Of second order where the steps differ too; at the two ends one-sided. NaN where a frame or one
    beside it is not known.

    Raises
    ------
    InputError
        Time does not increase.
    """
    _check_increasing(hand.time_s)
    if len(hand) < 2:
        return np.full_like(hand.theta, np.nan)
    velocity = np.gradient(hand.theta, hand.time_s, axis=0)
    # even steps leave the frame itself out of its difference
    return np.where(np.isfinite(hand.theta), velocity, np.nan)


def palm_angular_velocity(hand: Trajectory) -> Array:
    """Angular velocity of the palm ``(F, 3)`` in rad/s, camera frame, by central differences."""
    _check_increasing(hand.time_s)
    omega = np.full((len(hand), 3), np.nan)
    k = np.arange(len(hand))
    a, b = np.maximum(k - 1, 0), np.minimum(k + 1, len(hand) - 1)
    R = hand.palm_R
    turn = R[b] @ np.swapaxes(R[a], -1, -2)
    known = np.isfinite(turn).all(axis=(1, 2)) & (b > a) & np.isfinite(R).all(axis=(1, 2))
    if known.any():
        step_s = (hand.time_s[b] - hand.time_s[a])[known, None]
        omega[known] = rotation.log(turn[known]) / step_s
    return omega


def _interpolate(hand: Trajectory, time_s: Array) -> dict[str, Any]:
    """Fields at new times, linear between neighbours; turns go along the shortest arc."""
    t = hand.time_s
    a = np.clip(np.searchsorted(t, time_s + 1e-9, "right") - 1, 0, max(len(t) - 2, 0))
    b = np.minimum(a + 1, len(t) - 1)
    span = np.where(b > a, t[b] - t[a], 1.0)
    s = np.clip((time_s - t[a]) / span, 0.0, 1.0)
    s[np.abs(time_s - t[a]) < 1e-9] = 0.0

    def between(values: Array) -> Array:
        w = s.reshape(-1, *[1] * (values.ndim - 1))
        low, high = values[a], values[b]
        # a weight of exactly one end takes that end alone, so NaN beside it does not matter
        return np.where(w == 0, low, np.where(w == 1, high, (1 - w) * low + w * high))

    numbers = {name: between(getattr(hand, name)) for name in _NUMBERS}
    low, high = _unit(hand.palm_wxyz[a]), _unit(hand.palm_wxyz[b])
    q = np.where((s == 0)[:, None], low, np.where((s == 1)[:, None], high, slerp(low, high, s)))
    return numbers | {"palm_wxyz": _unit(q), "side": hand.side[a]}


def _aligned(wxyz: Array) -> Array:
    """The same turns with signs such that known neighbours in time lie on one side."""
    known = np.flatnonzero(np.isfinite(wxyz).all(axis=1))
    out = wxyz.copy()
    if len(known) > 1:
        q = wxyz[known]
        flips = np.sum(q[1:] * q[:-1], axis=1) < 0
        sign = np.concatenate([[1.0], np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)])
        out[known] = q * sign[:, None]
    return out


def _unit(wxyz: Array) -> Array:
    """Unit quaternions with ``w >= 0``."""
    q = wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def _check_increasing(time_s: Array) -> None:
    if np.any(np.diff(time_s) <= 0):
        k = int(np.flatnonzero(np.diff(time_s) <= 0)[0])
        raise InputError(
            f"time does not increase after frame {k} ({time_s[k]:g} s, then {time_s[k + 1]:g} s)"
        )


def _noted(hand: Trajectory, step: str) -> Trajectory:
    """The trajectory with one more step in its provenance."""
    steps = [*hand.provenance.get("steps", []), step]
    return replace(hand, provenance={**hand.provenance, "steps": steps})
