"""Inverse kinematics: the exact inverse of the kinematics, and honest where nothing can be seen."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.hand.inverse import angles_of_bones, angles_of_keypoints
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS

SHAPE = HandShape.default()


def test_inverts_the_kinematics() -> None:
    rng = np.random.default_rng(0)
    theta = rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (1000, 20))
    found, out = angles_of_keypoints(keypoints_mm(theta, SHAPE), SHAPE)
    np.testing.assert_allclose(found, theta, atol=1e-9)
    assert out.max() < 1e-9


@pytest.mark.parametrize("nudge", [0.0, 1e-7, -1e-7])
def test_abduction_of_a_finger_straight_out_of_the_palm_is_called_zero(nudge: float) -> None:
    theta = np.zeros((1, 20))
    theta[0, 4] = np.pi / 2 + nudge  # index MCP; its abduction now turns it about itself
    theta[0, 5] = 0.2
    found, _ = angles_of_keypoints(keypoints_mm(theta, SHAPE), SHAPE, damping=0.5)
    assert abs(found[0, 5]) < 1e-6
    assert found[0, 4] == pytest.approx(np.pi / 2, abs=1e-6)


def test_twist_shows_as_out_of_plane() -> None:
    theta = np.zeros(20)
    theta[[4, 6, 7]] = np.radians([30, 60, 40])
    bones = np.diff(keypoints_mm(theta, SHAPE)[1:].reshape(5, 4, 3), axis=1)
    rest = rotation.exp(SHAPE.rest_rotvec)
    for twist_deg, least, most in ((0, 0, 1e-6), (5, 3, 5), (15, 9, 15)):
        turned = rest.copy()
        turned[1] = rest[1] @ rotation.about_y(np.radians(twist_deg))
        _, out = angles_of_bones(bones, turned)
        assert least <= np.degrees(out[1]) <= most


def test_a_digit_that_is_not_known_leaves_the_others_alone() -> None:
    theta = np.full((1, 20), 0.3)
    points = keypoints_mm(theta, SHAPE)
    points[0, 7] = np.nan  # a joint of the index
    points[0, 20] = points[0, 19]  # a last bone without length
    found, _ = angles_of_keypoints(points, SHAPE)
    unknown = np.repeat([False, True, False, False, True], 4)
    assert np.isnan(found[0, unknown]).all()
    np.testing.assert_allclose(found[0, ~unknown], 0.3, atol=1e-9)
