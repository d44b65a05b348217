"""The cone filter: a centred triangle of 17 taps at 120 Hz, the same duration at other rates.

Tap ``j`` weighs ``1 - |j| / h`` for ``|j| < h``, with ``h = 9`` frames at 120 Hz, so that 17 taps
are above zero. It is symmetric, hence without lag; at the ends, and beside frames that are not
known, the weights that fall on known frames are renormalised.

>>> cone_taps(120.0).size, cone_taps(60.0).size
(17, 9)
>>> cone(np.ones((5, 1)), 120.0).ravel().tolist()
[1.0, 1.0, 1.0, 1.0, 1.0]
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import convolve1d

Array = NDArray[np.float64]

#: The paper's filter: taps, and the rate they are meant for.
TAPS, RATE_HZ = 17, 120.0


def cone_taps(rate_hz: float, taps: int = TAPS) -> Array:
    """The weights, summing to one; ``taps`` are counted at 120 Hz, and 0 or 1 filters nothing."""
    half = (taps + 1) / 2 * rate_hz / RATE_HZ
    reach = max(int(np.ceil(half)) - 1, 0)
    weights = 1 - np.abs(np.arange(-reach, reach + 1)) / max(half, 1.0)
    return np.asarray(weights / weights.sum())


def cone(values: ArrayLike, rate_hz: float, taps: int = TAPS) -> Array:
    """``values`` ``(F, ...)`` filtered along time; what is not known (NaN) stays so."""
    x = np.asarray(values, float)
    known = np.isfinite(x)
    weights = cone_taps(rate_hz, taps)
    total = convolve1d(np.where(known, x, 0.0), weights, axis=0, mode="constant")
    share = convolve1d(known.astype(float), weights, axis=0, mode="constant")
    return np.where(known, total / np.where(share > 0, share, 1.0), np.nan)


def lag_frames(estimate: ArrayLike, truth: ArrayLike, reach: int = 20) -> int:
    """The shift at which ``estimate`` ``(F, K)`` correlates best with ``truth``; late is > 0."""
    a = np.asarray(estimate, float)
    b = np.asarray(truth, float)
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    reach = min(reach, len(a) - 2)
    shifts = range(-reach, reach + 1)
    n = len(a)
    pairs = [(a[max(s, 0) : n + min(s, 0)], b[max(-s, 0) : n - max(s, 0)]) for s in shifts]
    score = [float(np.sum(p * q) / np.sqrt(np.sum(p * p) * np.sum(q * q))) for p, q in pairs]
    return list(shifts)[int(np.argmax(score))]
