"""Whole-hand proposals at the basis states: digits part-way along their line go to one of its ends.

A sweep moves one digit at a time under a palm that stays. Where the palm's tilt or depth and all
fingers are wrong together, and agree with the image together, no single digit can leave. The
paper's way out is its manifold: hands are mostly at basis configurations. So the digits are put
there at once, and the palm follows before anything else is asked.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def along_lines(theta: Array, lines: Array, precision: Array) -> Array:
    """Foot ``s`` ``(5,)`` of each digit on its line: 0 extended, 1 curled.

    Parameters
    ----------
    theta : (20,)
    lines : (5, 2, 4)
        Extended and curled state of each digit.
    precision : (5, 4, 4)
        The metric.
    """
    u = lines[:, 1] - lines[:, 0]
    Pu = np.einsum("dij,dj->di", precision, u)
    delta = theta.reshape(5, 4) - lines[:, 0]
    return np.asarray(np.sum(Pu * delta, axis=1) / np.sum(Pu * u, axis=1))


def snapped(theta: Array, lines: Array, precision: Array, rng: np.random.Generator) -> Array:
    """Angles ``(20,)`` with the fingers at the ends of their lines; spread and thumb as they were.

    A finger goes to its curled end if it is past a random share of the way, one share for all.
    """
    s = along_lines(theta, lines, precision)
    ends = (s > rng.uniform(0.25, 0.75)).astype(int)
    digits = theta.reshape(5, 4).copy()
    snap = lines[np.arange(5), ends]
    digits[1:, [0, 2, 3]] = snap[1:, [0, 2, 3]]
    return digits.ravel()
