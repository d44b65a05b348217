"""Weights of particles: normalising, effective sample size, resampling, tempering.

Log weights ``log_w`` ``(n,)`` need not be normalised; ``W`` are normalised weights. The effective
sample size of Kong, Liu and Wong is ``1 / sum W^2``, from 1 (one particle counts) to ``n``. A
likelihood that is a product over hundreds of pixels is far too peaked for a hundred particles:
:func:`temper` finds the exponent ``beta`` at which ``w L^beta`` keeps a stated share of them.

>>> import numpy as np
>>> logG = np.array([0.0, -100.0, -200.0, -300.0])
>>> beta = temper(np.zeros(4), logG, share=0.5)
>>> round(ess(beta * logG), 3), beta < 0.02
(2.0, True)
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError

Array = NDArray[np.float64]
Scheme = Literal["systematic", "residual"]


def normalise(log_w: Array) -> Array:
    """Normalised weights ``W`` ``(n,)``; uniform if no particle has any weight."""
    top = np.max(log_w)
    if not np.isfinite(top):
        return np.full(len(log_w), 1 / len(log_w))
    w = np.exp(log_w - top)
    return np.asarray(w / w.sum())


def ess(log_w: Array) -> float:
    """Effective sample size of log weights ``(n,)``."""
    return float(1 / np.sum(normalise(log_w) ** 2))


def log_mean(log_w: Array) -> float:
    """Logarithm of the mean of ``exp(log_w)``; minus infinity if all are."""
    top = np.max(log_w)
    if not np.isfinite(top):
        return float(-np.inf)
    return float(top + np.log(np.mean(np.exp(log_w - top))))


def power(logG: Array, beta: float) -> Array:
    """``log G^beta``, and minus infinity where ``G`` is zero, whatever ``beta``."""
    return np.where(np.isfinite(logG), beta * np.where(np.isfinite(logG), logG, 0), -np.inf)


def temper(log_w: Array, logG: Array, share: float, limit: float = 1.0, steps: int = 40) -> float:
    """Largest ``beta`` up to ``limit`` at which ``w G^beta`` keeps its effective sample size.

    Parameters
    ----------
    log_w, logG : (n,)
        Log weights so far and log likelihoods; ``G`` may be zero (minus infinity).
    share : float
        What must remain of the effective sample size that ``w`` has on the particles with
        ``G > 0``; 0 for no tempering.
    limit : float
        Where the likelihood counts in full.
    steps : int
        Halvings of the interval.
    """
    alive = np.isfinite(logG)
    if share <= 0 or not alive.any():
        return limit
    w, G = log_w[alive], logG[alive]
    wanted = share * ess(w)
    if ess(w + limit * G) >= wanted:
        return limit
    low, high = 0.0, limit  # the size at low is always enough, at high never
    for _ in range(steps):
        middle = (low + high) / 2
        if ess(w + middle * G) >= wanted:
            low = middle
        else:
            high = middle
    return low


def systematic(rng: np.random.Generator, W: Array, n: int) -> NDArray[np.intp]:
    """Indices ``(n,)``: one uniform number, ``n`` equal strides; particle ``i`` about ``n W_i``."""
    return _invert(W, (np.arange(n) + rng.random()) / n)


def residual(rng: np.random.Generator, W: Array, n: int) -> NDArray[np.intp]:
    """Indices ``(n,)``: ``floor(n W_i)`` of each, the rest drawn from what is left over."""
    expected = n * W / W.sum()
    whole = np.floor(expected).astype(np.intp)
    rest = n - int(whole.sum())
    drawn = _invert(expected - whole, rng.random(rest)) if rest else np.empty(0, np.intp)
    return np.concatenate([np.repeat(np.arange(len(W)), whole), drawn])


def _invert(W: Array, u: Array) -> NDArray[np.intp]:
    """Where the numbers ``u`` in [0, 1) fall among the cumulated weights ``W``."""
    cumulated = np.cumsum(W)
    return np.searchsorted(cumulated, u * cumulated[-1], side="right").clip(max=_last(W))


def _last(W: Array) -> int:
    """The last particle that has any weight (rounding must not pick a dead one)."""
    return int(np.flatnonzero(W)[-1])


_SCHEMES: dict[str, Callable[[np.random.Generator, Array, int], NDArray[np.intp]]] = {
    "systematic": systematic,
    "residual": residual,
}


def resample(
    rng: np.random.Generator, W: Array, n: int, scheme: Scheme = "systematic"
) -> NDArray[np.intp]:
    """Indices ``(n,)`` of particles with weights ``W``, by the named scheme.

    Raises
    ------
    InputError
        The scheme is not known.
    """
    if scheme not in _SCHEMES:
        raise InputError(f"resampling {scheme!r} is not known: {' or '.join(_SCHEMES)}")
    return _SCHEMES[scheme](rng, W, n)
