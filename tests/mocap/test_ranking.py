"""The ranking: by hand on a small case, and what it must not depend on."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import KEYPOINT_NAMES, LIMITS
from handtrack.mocap import pca
from handtrack.mocap.ranking import greedy, rank
from handtrack.mocap.settings import Handover

FOLDS = np.arange(400) // 100


@pytest.fixture(scope="module")
def hands() -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    slow = np.cumsum(rng.normal(size=(400, 20)), axis=0)
    slow = (slow - slow.min(axis=0)) / np.ptp(slow, axis=0)
    theta = LIMITS[:, 0] + (LIMITS[:, 1] - LIMITS[:, 0]) * slow
    keep = [k for k in range(1, 21) if k not in (1, 5, 9, 13, 17)]
    points = keypoints_mm(theta, HandShape.default())[:, keep]
    return tuple(KEYPOINT_NAMES[k] for k in keep), points, theta


def test_pca_is_that_of_the_covariance(hands):
    X = hands[1].reshape(400, -1)
    got = pca.fit(X)
    np.testing.assert_allclose(got.variance, np.linalg.eigvalsh(np.cov(X.T))[::-1], atol=1e-8)
    np.testing.assert_allclose(got.components @ got.components.T, np.eye(45), atol=1e-10)
    np.testing.assert_allclose(got.back(got.scores(X)), X, atol=1e-9)


def test_algorithm_1_by_hand():
    # two markers on lines of their own: eigenvalues 200/3 and 2/3, components along the axes
    moves = np.zeros((4, 2, 3))
    moves[:, 0, 0], moves[:, 1, 1] = [-10, -10, 10, 10], [-1, 1, 1, -1]
    ranking = rank(("far", "near"), moves)
    assert ranking.order == ("far", "near")
    np.testing.assert_allclose(ranking.share, [100 / 101, 1 / 101], atol=1e-12)


def test_does_not_depend_on_how_the_root_frame_is_turned(hands):
    labels, X, _ = hands
    plain = rank(labels, X)
    for turn in rotation.exp(np.random.default_rng(0).normal(size=(5, 3))):
        turned = rank(labels, X @ turn.T + [10, 20, 30])
        assert turned.order == plain.order
        np.testing.assert_allclose(turned.share, plain.share, atol=1e-9)


@pytest.mark.parametrize("components", [0, 3, 10])
def test_the_best_six_contain_the_best_three(hands, components):
    labels, X, _ = hands
    ranking = rank(labels, X, components)
    assert set(ranking.top(3)) < set(ranking.top(6))
    assert sorted(ranking.order) == sorted(labels)
    assert sum(ranking.share) == pytest.approx(1)
    assert list(ranking.share) == sorted(ranking.share, reverse=True)


def test_fingertips_come_before_knuckles(hands):
    labels, X, _ = hands
    order = rank(labels, X).order
    for digit in ("index", "middle", "ring", "little"):
        assert order.index(f"{digit}_tip") < order.index(f"{digit}_pip")


def test_greedy_is_nested_and_beats_the_worst_set(hands):
    labels, X, theta = hands
    three = greedy(labels, X, theta, 3, Handover(), FOLDS, frames=200)
    two = greedy(labels, X, theta, 2, Handover(), FOLDS, frames=200)
    assert three.top(2) == two.order
    assert len(set(three.order)) == 3


def test_frames_with_a_gap_are_left_out(hands):
    labels, X, _ = hands
    holed = X.copy()
    holed[::7, 3] = np.nan
    kept = np.isfinite(holed).all(axis=(1, 2))
    assert rank(labels, holed) == rank(labels, X[kept])
    with pytest.raises(InputError, match="two frames or more"):
        rank(labels, np.full_like(X, np.nan))
