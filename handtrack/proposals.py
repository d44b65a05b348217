"""Where in a silhouette the proposer is asked, and which way up it sees the hand."""

import numpy as np

from handtrack.estimate import Estimate
from handtrack.proposer import facing_cue
from handtrack.proposer.network import PLACED, Hypotheses, propose
from handtrack.proposer.picture import PALM_PER_DISC, Square, picture_of
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod
from handtrack.seeds import fingers_from

#: Turns in which a hand is shown to the network whose direction is not known.
QUARTERS = np.radians([0.0, 90.0, 180.0, 270.0])


def hypotheses_of(
    view: View, method: RefinedMethod, known: Estimate | None = None
) -> Hypotheses | None:
    """What the network makes of the silhouette about its discs, and about a known hand.

    It sees the hand upright, as far as that is known. None where there is no silhouette.
    """
    discs = view.discs
    if not discs:
        return None
    towards = fingers_from(view, known)
    turns = QUARTERS if towards is None else np.array([towards])
    squares = [Square(centre, radius, t) for centre, radius in discs for t in turns]
    if known is not None:
        squares.append(square_about(view, method, known))
    mask = view.sdf < 0
    return Hypotheses.joined([propose(view.grey, mask, s, view.intrinsics) for s in squares])


def hypotheses_near(view: View, method: RefinedMethod, known: Estimate) -> Hypotheses:
    """What the network makes of the silhouette about a known hand alone."""
    square = square_about(view, method, known)
    return propose(view.grey, view.sdf < 0, square, view.intrinsics)


def shown_log_odds(view: View, method: RefinedMethod, known: Estimate) -> facing_cue.LogOdds:
    """What a known hand shows, whichever hand it is."""
    square = square_about(view, method, known)
    return facing_cue.log_odds(picture_of(view.grey, view.sdf < 0, square))


def square_about(view: View, method: RefinedMethod, known: Estimate) -> Square:
    """The square in which the network expects a known hand."""
    fx, fy, cx, cy = view.intrinsics
    length = method.shape.palm_length_mm
    x, y, z = known.pose @ np.array([0.0, PLACED * length, 0.0])
    at = np.array([fx * x / z + cx, fy * y / z + cy])
    return Square(at, fx * length / z / PALM_PER_DISC, fingers_from(view, known) or 0.0)
