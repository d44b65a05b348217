"""Whole-hand proposals at the basis states."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.records import Pose
from handtrack.refine.snap import along_lines, snapped
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod


@pytest.mark.parametrize("s", [0.0, 0.3, 1.0])
def test_a_point_of_the_line_is_its_own_foot(method: RefinedMethod, s: float) -> None:
    theta = (1 - s) * method.lines[:, 0] + s * method.lines[:, 1]
    found = along_lines(theta.ravel(), method.lines, method.precision)
    np.testing.assert_allclose(found, s, atol=1e-12)


def test_the_foot_minimises_the_distance(method: RefinedMethod) -> None:
    theta = np.random.default_rng(0).normal(0.4, 0.3, 20)
    at = along_lines(theta, method.lines, method.precision)

    def distances(s: np.ndarray) -> np.ndarray:
        off = theta.reshape(5, 4) - method.lines[:, 0]
        off = off - s[:, None] * (method.lines[:, 1] - method.lines[:, 0])
        return np.einsum("di,dij,dj->d", off, method.precision, off)

    assert (distances(at) < distances(at + 1e-3)).all()
    assert (distances(at) < distances(at - 1e-3)).all()


def test_fingers_go_to_the_nearer_end_and_keep_their_spread(method: RefinedMethod) -> None:
    s = np.array([0.5, 0.1, 0.9, 0.2, 0.8])[:, None]
    theta = ((1 - s) * method.lines[:, 0] + s * method.lines[:, 1]).ravel()
    new = snapped(theta, method.lines, method.precision, np.random.default_rng(0)).reshape(5, 4)
    for finger, end in enumerate((0, 1, 0, 1), start=1):
        state = method.lines[finger, end]
        np.testing.assert_array_equal(new[finger, [0, 2, 3]], state[[0, 2, 3]])
    np.testing.assert_array_equal(new[:, 1], theta.reshape(5, 4)[:, 1])
    np.testing.assert_array_equal(new[0], theta[:4])


def test_four_fingers_half_bent_and_a_nearer_palm_come_free_together(
    method: RefinedMethod, view: View, truth: tuple[Pose, np.ndarray]
) -> None:
    """The start that sweeps of one digit cannot leave: every finger bent, the palm nearer."""
    pose, theta = truth
    bent = theta.copy()
    bent[[4, 6, 7, 8, 10, 11, 12, 14, 15, 16, 18, 19]] += 0.3
    near = Pose(rotation.exp([0.15, 0.0, 0.0]) @ pose.R, pose.t_mm * 0.95)

    seed = Estimate(near, bent, np.full(20, 0.2))
    found = method.search(view, seed, np.random.default_rng(1))
    before = np.abs(bent - theta).mean()
    assert np.abs(found.theta - theta).mean() < 0.5 * before
