"""The basis states: each digit fully extended or fully curled, 32 patterns, 28 of them kept.

**Extended and curled** come from recordings. In each set, a digit is extended in the tenth of the
frames in which its flexions sum to least, and curled in the tenth in which they sum to most;
the medians of these are the set's two ends. Sensors saturate (one stops DIPs at 45 deg, another
never sees a tight fist), so of the sets' ends the one nearer to the flat hand is *extended* and
the one farther from it *curled*, angle by angle; abductions are averaged. The thumb's curled end
lies across the palm.

**Support.** A digit's curl is the projection of its flexions onto the way from extended to
curled, 0 to 1. A frame belongs to the pattern to which its five curls round, and, softly, to all
patterns by the product of ``c`` for curled digits and ``1 - c`` for extended ones. The sets weigh
the same, however long they are.

**Which four fall** (the paper does not say): those to which the fewest frames belong. Many have
none; among equals the ones that a hand does not do go first, ring extended while middle and
little are bent (they share muscle and tendon), then the ones with least soft support. In the
recordings that the package is fitted from, that anatomical rule names exactly the four that fall.

>>> state = np.zeros((1, 20))
>>> curls(state, np.zeros(20), np.ones(20)).tolist()
[[0.0, 0.0, 0.0, 0.0, 0.0]]
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_ANGLES
from handtrack.hand.space import ALL_PATTERNS, PATTERN_WEIGHTS, kept_patterns

Array = NDArray[np.float64]

#: Share of the frames at either end of a digit's flexion that define extended and curled.
END_SHARE = 0.1
_FLEXIONS = (0, 2, 3)


@dataclass(frozen=True, eq=False)
class Basis:
    """The states kept, and the support of all 32 patterns."""

    extended: Array  # (20,)
    curled: Array  # (20,)
    states: NDArray[np.bool_]  # (keep, 5)
    support: Array  # (32,) share of the frames that round to each pattern
    falling: NDArray[np.int64]  # (32,) patterns, the first to fall first

    @property
    def theta(self) -> Array:
        """Angles ``(keep, 20)`` of the states."""
        return np.where(np.repeat(self.states, 4, axis=1), self.curled, self.extended)


def choose_basis(sets: list[Array], keep: int = 28) -> Basis:
    """The basis of recorded sets, each ``(n, 20)``; ``keep`` of the 32 patterns.

    Raises
    ------
    InputError
        ``keep`` is not from 2 to 32, or there is no recording.
    """
    if not sets or min(map(len, sets)) == 0:
        raise InputError("the basis states need recordings, and there are none")
    extended, curled = ends(sets)
    shares = [pattern_support(curls(theta, extended, curled)) for theta in sets]
    hard, soft = (np.mean(share, axis=0) for share in zip(*shares, strict=True))
    falling = np.lexsort((soft, ~unnatural(ALL_PATTERNS), hard))
    return Basis(extended, curled, kept_patterns(falling, keep), hard, falling)


def ends(sets: list[Array]) -> tuple[Array, Array]:
    """The extended and the curled hand ``(20,)`` of recorded sets."""
    low = np.array([_end(theta, top=False) for theta in sets])
    high = np.array([_end(theta, top=True) for theta in sets])
    columns = np.arange(N_ANGLES)
    extended = low[np.abs(low).argmin(axis=0), columns]
    curled = high[np.abs(high).argmax(axis=0), columns]
    abductions = columns % 4 == 1
    return (
        np.where(abductions, low.mean(axis=0), extended),
        np.where(abductions, high.mean(axis=0), curled),
    )


def _end(theta: Array, top: bool) -> Array:
    end = np.empty(N_ANGLES)
    for d in range(5):
        digit = theta[:, 4 * d : 4 * d + 4]
        bend = digit[:, _FLEXIONS].sum(axis=1) * (1 if top else -1)
        end[4 * d : 4 * d + 4] = np.median(digit[bend >= np.quantile(bend, 1 - END_SHARE)], axis=0)
    return end


def curls(theta: Array, extended: Array, curled: Array) -> Array:
    """Curl ``(n, 5)`` of each digit, 0 extended to 1 curled, of angles ``(n, 20)``."""
    way = (curled - extended).reshape(5, 4)[:, _FLEXIONS]
    at = (theta - extended).reshape(-1, 5, 4)[..., _FLEXIONS]
    return np.clip((at * way).sum(-1) / (way * way).sum(-1), 0.0, 1.0)


def pattern_support(c: Array) -> tuple[Array, Array]:
    """Share of frames that round to each pattern ``(32,)``, and the soft share ``(32,)``."""
    hard = np.bincount((c > 0.5) @ PATTERN_WEIGHTS, minlength=len(ALL_PATTERNS)) / len(c)
    soft = np.where(ALL_PATTERNS, c[:, None], 1 - c[:, None]).prod(axis=-1).mean(axis=0)
    return hard, soft


def unnatural(patterns: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Ring extended while middle and little are bent."""
    return patterns[:, 2] & ~patterns[:, 3] & patterns[:, 4]
