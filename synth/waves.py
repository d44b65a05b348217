"""Two ways to pass time smoothly: the minimum-jerk step and slow random waves.

>>> import numpy as np
>>> minimum_jerk(np.array([-1.0, 0.0, 0.5, 1.0])).tolist()
[0.0, 0.0, 0.5, 1.0]
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def minimum_jerk(s: Array) -> Array:
    """``10 s^3 - 15 s^4 + 6 s^5`` of ``s`` clipped to 0..1 (Flash and Hogan 1985)."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def sines(
    rng: np.random.Generator,
    clock: Array,
    length: float,
    n: int,
    slow_hz: float = 0.08,
    fast_hz: float = 0.4,
    together: bool = False,
) -> Array:
    """Slow random waves ``(len(clock), n)`` whose largest value over the clip is 1."""
    rate = rng.uniform(slow_hz, fast_hz, (3, n))
    phase = rng.uniform(0, 2 * np.pi, (3, n))
    size = rng.uniform(0.4, 1.0, (3, n))

    def wave(t: Array) -> Array:
        return np.sum(size * np.sin(2 * np.pi * rate * t[:, None, None] + phase), axis=1)

    grid = wave(np.linspace(0.0, length, 400))
    peak = np.linalg.norm(grid, axis=1).max() if together else np.abs(grid).max(axis=0)
    return wave(clock) / peak
