"""What colours are worth beside the shape cue: whether they tell a hand without it, and how far.

Before a wall they do; before a face of their own tone they are sure of much that is wrong.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

#: Share of the hand and of what is around it that colours may take for the other without help.
MOST_MISTAKEN = 0.03
#: Log odds from which the shape cue is sure.
SURE_SHAPE = 2.0
#: Where the shape cue sees a hand, and denies more than this of what colours take for it, they have
#: swallowed something else: a face behind it.
MOST_DENIED = 0.12


def need_help(odds: Float, shape: Float, inside: Mask) -> bool:
    """Whether colours cannot tell a hand ``inside`` ``(h, w)`` from what is around it.

    They take some of one for the other, or the shape cue contradicts them.
    """
    mask, kernel = inside.astype(np.uint8), np.ones((5, 5), np.uint8)
    deep = cv2.erode(mask, kernel, borderValue=1) > 0
    around = near(inside) & (cv2.dilate(mask, kernel) == 0)
    mistaken = max(_share(odds <= 0, deep), _share(odds > 0, around))
    return mistaken > MOST_MISTAKEN or contradicted(odds, shape, inside)


def contradicted(odds: Float, shape: Float, inside: Mask) -> bool:
    """Whether the shape cue denies what colours claim about a hand ``inside`` ``(h, w)``.

    Parameters
    ----------
    odds, shape : (h, w)
        Log odds by colours and by shape.
    inside : (h, w) bool
    """
    close, hand = near(inside), odds > 0
    seen, denied = close & (shape > SURE_SHAPE), shape < -SURE_SHAPE
    claimed = _share(denied, close & hand)
    swallowed = claimed > MOST_DENIED and bool(seen.any())
    return min(_share(~hand, seen), claimed) > MOST_MISTAKEN or swallowed


def worth_of(odds: Float, shape: Float) -> float:
    """What log odds ``(n,)`` by colours are worth where ``shape`` ``(n,)`` are those by shape.

    The slope, 0 to 1, of the logistic regression of the one's probability on the other: colours
    that are sure of what the shape cue denies have a small one.

    >>> by_shape = np.linspace(-4, 4, 50)
    >>> round(worth_of(by_shape, by_shape), 2), round(worth_of(4 * by_shape, by_shape), 2)
    (1.0, 0.25)
    """
    probability = 1 / (1 + np.exp(-shape))

    def cross_entropy(slope: float) -> float:
        return float(np.mean(np.logaddexp(0.0, slope * odds) - probability * slope * odds))

    return float(minimize_scalar(cross_entropy, bounds=(0.0, 1.0), method="bounded").x)


def near(inside: Mask) -> Mask:
    """A silhouette and what is within twenty pixels of it."""
    return np.asarray(cv2.dilate(inside.astype(np.uint8), np.ones((41, 41), np.uint8)) > 0)


def _share(what: Mask, where: Mask) -> float:
    """Share of ``where`` that is ``what``; 0 of nothing."""
    return float(what[where].mean()) if where.any() else 0.0
