"""What a search without an idea of the pose may find."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.records import Pose
from handtrack.seeds import FACING, facing_as_told


def seen_from(side: str, turn_deg: float) -> Estimate:
    """A hand that shows one side, turned about its own length."""
    R = FACING[side] @ rotation.about_y(np.radians(turn_deg))
    return Estimate(Pose(R, np.array([0.0, 0.0, 500.0])), np.zeros(20), np.ones(20))


@pytest.mark.parametrize("side", ["palm", "back"])
def test_a_hand_that_was_turned_over_by_refinement_is_not_what_was_sought(side):
    turns = (0.0, 80.0, 100.0, 150.0)
    hands = [seen_from(side, turn) for turn in turns]
    kept = facing_as_told(hands, (side,))
    assert kept == hands[:3]  # a little past edge-on will do
    assert facing_as_told(hands, ("palm", "back")) == hands
