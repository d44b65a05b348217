"""Weights that stop wrong matches from pulling: Huber and Tukey, on a robust scale.

The scale of residuals is 1.4826 times the median of their absolute values, the standard
deviation if they are normal, but not below a floor. Huber's weight falls as one over the
residual beyond 1.345 scales; Tukey's reaches zero at 4.685.

>>> import numpy as np
>>> residuals = np.array([0.1, -0.2, 0.15, -0.1, 50.0])
>>> weights, scale = robust_weights(residuals, kind="tukey", floor=0.1)
>>> round(scale, 3), float(weights[4]), bool((weights[:4] > 0.8).all())
(0.222, 0.0, True)
"""

from typing import Literal

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["huber", "tukey"]

HUBER, TUKEY = 1.345, 4.685  # 95 % efficient where errors are normal


def robust_weights(residuals: Array, kind: Kind, floor: float) -> tuple[Array, float]:
    """Weights ``(n,)`` in [0, 1] of residuals ``(n,)``, and their scale (``floor`` if none)."""
    weights = np.empty(len(residuals))
    scale = _weigh(residuals, kind == "huber", float(floor), weights)
    return weights, scale


@numba.njit(cache=True)
def _weigh(residuals, huber, floor, weights):  # type: ignore[no-untyped-def]
    """Fill ``weights``; the scale."""
    if len(residuals) == 0:
        return floor
    scale = max(1.4826 * np.median(np.abs(residuals)), floor)
    for i in range(len(residuals)):
        r = abs(residuals[i]) / scale
        if huber:
            weights[i] = HUBER / max(r, HUBER)
        else:
            weights[i] = (1 - (r / TUKEY) ** 2) ** 2 if r < TUKEY else 0.0
    return scale
