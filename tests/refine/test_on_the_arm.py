"""A palm on the forearm, with the fist for fingers, is told from a hand."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.judge import ON_THE_ARM, lies_on_the_arm, overlap
from handtrack.records import Pose

STD = np.full(20, 0.2)


def on_the_arm(pose):
    """The edge of a palm one palm further down the arm, fingers straight up into the fist."""
    edge_on = pose.R @ rotation.about_y(np.radians(80.0))
    return Estimate(Pose(edge_on, pose.t_mm + np.array([0.0, 80.0, 0.0])), np.zeros(20), STD)


def test_a_fist_is_where_the_silhouette_is_widest(method, view_of_fist, fist):
    pose, theta = fist
    found = Estimate(pose, theta, STD)
    assert not lies_on_the_arm(method.hand, found, view_of_fist)
    assert overlap(method.hand, found, view_of_fist, 6.0) > 0.9


def test_a_palm_on_the_forearm_is_not(method, view_of_fist, fist):
    wrong = on_the_arm(fist[0])
    assert lies_on_the_arm(method.hand, wrong, view_of_fist)
    assert overlap(method.hand, wrong, view_of_fist, 6.0) <= ON_THE_ARM


@pytest.mark.parametrize(
    "turn", [(0, 0, 0), (0.5, 0, 0), (-0.5, 0, 0), (0, 0.6, 0), (0, -0.6, 0.4)]
)
def test_nor_is_it_said_of_a_hand_that_is_seen(method, view, truth, turn):
    pose, theta = truth
    turned = Estimate(Pose(rotation.exp(np.array(turn)) @ pose.R, pose.t_mm), theta, STD)
    assert not lies_on_the_arm(method.hand, turned, view)


def test_a_palm_that_points_at_the_camera_says_nothing(method, view_of_fist, fist):
    wrong = on_the_arm(fist[0])
    pitched = Pose(rotation.about_x(np.radians(65.0)) @ wrong.pose.R, wrong.pose.t_mm)
    assert not lies_on_the_arm(method.hand, Estimate(pitched, wrong.theta, STD), view_of_fist)
