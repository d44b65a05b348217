"""Which side of which hand a picture shows: the facing cue.

A silhouette does not tell: the palm of one hand is the back of the other. Creases, nails, shading
and fingers that curl before the palm or behind it do, now more, now less. Nor does a rough one tell
a thumb from a little finger, or from what is behind the hand. A small network that learned from
renders (``handtrack.bench.training``) says how much of both is in a single frame;
:mod:`handtrack.facing_test` adds it up.

>>> from handtrack.proposer.picture import SIDE_PX
>>> picture = np.random.default_rng(0).random((2, SIDE_PX, SIDE_PX), np.float32)
>>> one, mirrored = log_odds(picture), log_odds(picture[..., ::-1])
>>> abs(one.palm - mirrored.palm) < 1e-4, abs(one.thumb_right + mirrored.thumb_right) < 1e-4
(True, True)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.trained import shipped

WEIGHTS = "facing_cue.onnx"


class LogOdds(NamedTuple):
    """Of a palm; and of a thumb to the right of fingers that point up.

    A right hand's thumb is there where its palm is shown, a left hand's where its back is.
    """

    palm: float
    thumb_right: float


def log_odds(picture: NDArray[np.float32]) -> LogOdds:
    """What a hand shows, from its silhouette and shading.

    The mean of what is said of the picture and of its mirror image: what only one of them says
    is no reason.

    Parameters
    ----------
    picture : (2, SIDE_PX, SIDE_PX)
        As :func:`handtrack.proposer.picture.picture_of` makes it, fingers up.
    """
    network = shipped("handtrack.proposer", WEIGHTS)
    one, mirrored = (
        network(np.ascontiguousarray(seen[None]))[0] for seen in (picture, picture[..., ::-1])
    )
    return LogOdds(float(one[0] + mirrored[0]) / 2, float(one[1] - mirrored[1]) / 2)
