"""The line along which a digit moves, and how far it keeps from it, as recordings have it.

The basis states (:mod:`handtrack.hand.basis`) are extremes: flat, and curled as far as anyone
curled. That is what a filter's samples should span; but a hand at rest is not flat and a bent
finger is seldom clenched, so a prior whose line ends there pulls every finger past where it is.
What is usual, the median of recorded digits near either end, errs the other way: sensors saturate
(one stops DIPs at 45 deg). A digit's line runs between the middles of the two.
"""

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.basis import curls
from handtrack.hand.space import ConfigurationSpace
from handtrack.mocap.recordings import shipped_motion

Array = NDArray[np.float64]

#: Curl up to which a recorded digit counts as near its extended end, and from which near the other.
NEAR_EXTENDED, NEAR_CURLED = 0.2, 0.7
#: Fewer recorded digits than this say nothing of what is usual.
FEWEST = 10


def digit_lines(space: ConfigurationSpace) -> Array:
    """Where the line of each digit begins and ends ``(5, 2, 4)``, in radians."""
    lines = np.stack([space.extended, space.curled]).reshape(2, 5, 4)
    recorded = shipped_motion().theta
    curl = curls(recorded, space.extended, space.curled)
    for end, near in enumerate((curl < NEAR_EXTENDED, curl > NEAR_CURLED)):
        for d in range(5):
            digits = recorded[near[:, d], 4 * d : 4 * d + 4]
            if len(digits) >= FEWEST:
                lines[end, d] = 0.5 * (lines[end, d] + np.median(digits, axis=0))
    return np.asarray(lines.transpose(1, 0, 2))


def off_line_precision(
    space: ConfigurationSpace, lines: Array, widen: float, floor_deg: float
) -> Array:
    """Precision ``(5, 4, 4)`` of a digit's deviation from its line ``(2, 4)``.

    The covariance of the space without its part along the line, times ``widen``, and a floor:
    between its ends a digit is free, off the line it is as likely as it was in the recordings.
    """
    u = lines[:, 1] - lines[:, 0]
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    off = np.eye(4) - u[:, :, None] * u[:, None, :]
    blocks = np.stack([space.covariance[4 * d : 4 * d + 4, 4 * d : 4 * d + 4] for d in range(5)])
    covariance = widen * off @ blocks @ off
    return np.asarray(np.linalg.inv(covariance + np.radians(floor_deg) ** 2 * np.eye(4)))
