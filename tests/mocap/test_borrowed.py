"""Poses of other hands, placed on the data base's own hand."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.mocap.borrowed import enlarged
from handtrack.mocap.recordings import shipped_motion
from handtrack.mocap.regression import Regression
from handtrack.mocap.settings import Handover
from handtrack.mocap.validation import regressed

TIPS = [4, 8, 12, 16, 20]


@pytest.fixture(scope="module")
def open_hands() -> tuple[np.ndarray, np.ndarray]:
    """Markers and angles of a slender hand that never makes a fist."""
    rng = np.random.default_rng(5)
    low, high = LIMITS[:, 0], LIMITS[:, 1]
    theta = low + (high - low) * np.clip(rng.normal(0.3, 0.08, (600, 20)), 0, 0.5)
    return keypoints_mm(theta, HandShape.default().scaled(0.9))[:, TIPS], theta


def test_borrowed_poses_have_their_markers_where_this_hand_has_them(open_hands):
    X, theta = open_hands
    more, angles = enlarged(X, theta, 40)
    np.testing.assert_array_equal(more[:600], X)
    np.testing.assert_array_equal(angles[:600], theta)
    poses = shipped_motion().theta
    assert {tuple(row) for row in angles[600:]} <= {tuple(row) for row in poses}
    true = keypoints_mm(angles[600:], HandShape.default().scaled(0.9))[:, TIPS]
    assert np.median(np.linalg.norm(more[600:] - true, axis=-1)) < 1.0


def test_borrowed_poses_hold_still_and_missing_markers_do_not_matter(open_hands):
    X, theta = open_hands
    gaps = X.copy()
    gaps[::7, 2] = np.nan
    windows = np.concatenate([gaps, X, X], axis=1)
    more, _ = enlarged(windows, theta, 10, n_markers=len(TIPS))
    assert more.shape == (610, 3 * len(TIPS), 3)
    for k in (1, 2):
        np.testing.assert_array_equal(
            more[600:, : len(TIPS)], more[600:, k * len(TIPS) : (k + 1) * len(TIPS)]
        )
    assert np.isfinite(more[600:]).all()


def test_nothing_is_borrowed_unless_asked_and_never_more_than_ships(open_hands):
    X, theta = open_hands
    same, angles = enlarged(X, theta, 0)
    assert same is X
    assert angles is theta
    assert len(enlarged(X, theta, 10**6)[0]) == 600 + len(shipped_motion().theta)
    with pytest.raises(InputError, match="-1 poses cannot be borrowed"):
        Handover(borrow=-1)


def test_a_fist_that_the_data_base_lacks_is_nearer(open_hands):
    X, theta = open_hands
    poses = shipped_motion().theta
    bent = np.sort(poses[:, [6, 10, 14, 18]].mean(axis=1))
    fists = poses[poses[:, [6, 10, 14, 18]].mean(axis=1) > bent[-60]]
    fists = fists + np.random.default_rng(0).normal(0, 0.05, fists.shape)
    Q = keypoints_mm(fists, HandShape.default().scaled(0.9))[:, TIPS]
    nearest = Regression(ridge_mm=0.5, power=3.0)
    off = [
        np.abs(regressed(Handover(nearest), *enlarged(X, theta, n), Q)[0] - fists).mean()
        for n in (0, 200)
    ]
    assert off[1] < 0.7 * off[0]
