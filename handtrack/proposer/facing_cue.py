"""Which side of a hand a picture shows, the palm or the back: the facing cue.

A silhouette does not tell: the palm of one hand is the back of the other. Creases, nails, shading
and fingers that curl before the palm or behind it do, now more, now less. A small network that
learned from renders (``handtrack.bench.training``) says how much in a single frame;
:mod:`handtrack.facing_test` adds it up.

>>> from handtrack.proposer.picture import SIDE_PX
>>> picture = np.random.default_rng(0).random((2, SIDE_PX, SIDE_PX), np.float32)
>>> abs(log_odds(picture) - log_odds(picture[..., ::-1])) < 1e-4
True
"""

import numpy as np
from numpy.typing import NDArray

from handtrack.trained import shipped

WEIGHTS = "facing_cue.onnx"


def log_odds(picture: NDArray[np.float32]) -> float:
    """Log odds that a hand shows its palm, from its silhouette and shading.

    The mean of what is said of the picture and of its mirror image: what only one of them says
    is no reason.

    Parameters
    ----------
    picture : (2, SIDE_PX, SIDE_PX)
        As :func:`handtrack.proposer.picture.picture_of` makes it, fingers up.
    """
    network = shipped("handtrack.proposer", WEIGHTS)
    both = (picture, picture[..., ::-1])
    return float(np.mean([network(np.ascontiguousarray(one[None])).item() for one in both]))
