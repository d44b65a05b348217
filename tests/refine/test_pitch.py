"""The palm pitches, the fingers make up for it."""

import numpy as np

from handtrack import rotation
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import TIPS
from handtrack.refine.pitch import pitched


def bones(pose, theta, shape):
    points = pose @ keypoints_mm(theta, shape)
    return np.stack([np.diff(points[tip - 3 : tip + 1], axis=0) for tip in TIPS[1:]])


def straight(shape):
    """A hand whose fingers have no fan and no roll: then making up for it is exact."""
    return HandShape(
        **{**vars(shape), "rest_rotvec": shape.rest_rotvec * np.array([1.0, 0, 0, 0, 0])[:, None]}
    )


def test_fingers_of_parallel_axes_keep_their_directions(truth) -> None:
    pose, theta = truth
    theta = theta.copy()
    theta[[5, 9, 13, 17]] = 0.0
    shape = straight(HandShape.default())
    tilted, fingers = pitched(pose, theta, shape, 0.3)
    assert abs(rotation.angle_between(tilted.R, pose.R) - 0.3) < 1e-9
    np.testing.assert_allclose(bones(tilted, fingers, shape), bones(pose, theta, shape), atol=1e-9)


def test_the_knuckles_stay_and_no_pitch_changes_nothing(truth) -> None:
    pose, theta = truth
    shape = HandShape.default()
    tilted, fingers = pitched(pose, theta, shape, -0.4)
    knuckles = shape.base_mm[1:].mean(axis=0)
    np.testing.assert_allclose(tilted @ knuckles, pose @ knuckles, atol=1e-9)
    same, as_before = pitched(pose, theta, shape, 0.0)
    np.testing.assert_allclose(same.R, pose.R, atol=1e-12)
    np.testing.assert_array_equal(as_before, theta)
    assert not np.allclose(fingers, theta)
