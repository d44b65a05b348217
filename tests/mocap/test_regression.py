"""Locally weighted regression against scikit-learn, and its axioms."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.mocap.regression import Regression, predict

SAME_RAD = 1e-6
SIX = [4, 8, 12, 16, 20, 6]


@pytest.fixture(scope="module")
def hands() -> tuple[np.ndarray, np.ndarray]:
    """Six markers and 20 angles of 600 hands."""
    rng = np.random.default_rng(5)
    low, high = LIMITS[:, 0], LIMITS[:, 1]
    theta = low + (high - low) * np.clip(rng.normal(0.4, 0.15, (600, 20)), 0, 1)
    return keypoints_mm(theta, HandShape.default())[:, SIX], theta


def by_scikit_learn(X, Y, Q, power=1.0, nearest=None):
    answers = []
    for q in Q.reshape(len(Q), -1):
        flat = X.reshape(len(X), -1)
        distance = np.linalg.norm(flat - q, axis=1)
        rows = np.argsort(distance)[:nearest]
        model = LinearRegression().fit(flat[rows], Y[rows], sample_weight=distance[rows] ** -power)
        answers.append(model.predict(q[None])[0])
    return np.array(answers)


@pytest.mark.parametrize("n_markers", [3, 6])
def test_is_the_weighted_linear_regression_of_scikit_learn(hands, n_markers):
    X, Y = hands[0][:, :n_markers], hands[1]
    got = predict(Regression(), X[:500], Y[:500], X[500:]).mean
    np.testing.assert_allclose(got, by_scikit_learn(X[:500], Y[:500], X[500:]), atol=SAME_RAD)


def test_neighbours_and_power_are_those_of_scikit_learn(hands):
    X, Y = hands
    got = predict(Regression(neighbours=80, power=2), X[:500], Y[:500], X[500:]).mean
    expected = by_scikit_learn(X[:500], Y[:500], X[500:], 2.0, 80)
    np.testing.assert_allclose(got, expected, atol=SAME_RAD)


def test_more_frames_than_fit_in_one_block(hands):
    X, Y = np.tile(hands[0], (8, 1, 1)), np.tile(hands[1], (8, 1))
    X = X + np.random.default_rng(0).normal(0, 1, X.shape)
    got = predict(Regression(), X, Y, hands[0][:3]).mean
    np.testing.assert_allclose(got, by_scikit_learn(X, Y, hands[0][:3]), atol=SAME_RAD)


def test_exact_where_the_data_base_contains_the_query(hands):
    X, Y = hands
    for settings in (Regression(), Regression(neighbours=50, ridge_mm=1.0)):
        got = predict(settings, X, Y, X[::50]).mean
        np.testing.assert_allclose(got, Y[::50], atol=1e-14)


def test_continuous_towards_a_data_base_frame(hands):
    X, Y = hands
    got = predict(Regression(), X, Y, X[:20] + 1e-5).mean
    np.testing.assert_allclose(got, Y[:20], atol=1e-4)


def test_a_linear_map_is_recovered_whatever_the_weights():
    rng = np.random.default_rng(1)
    X, Q = rng.normal(0, 30, (300, 2, 3)), rng.normal(0, 30, (40, 2, 3))
    B = rng.normal(size=(6, 4))
    got = predict(Regression(), X, X.reshape(300, 6) @ B + 1, Q)
    np.testing.assert_allclose(got.mean, Q.reshape(40, 6) @ B + 1, atol=1e-8)
    assert got.std.max() < 1e-5


def test_markers_that_never_move_change_nothing(hands):
    X, Y = hands
    still = np.tile([1.0, 2.0, 3.0], (len(X), 1, 1))
    more = np.concatenate([X, still], axis=1)
    plain = predict(Regression(), X[:500], Y[:500], X[500:]).mean
    got = predict(Regression(), more[:500], Y[:500], more[500:]).mean
    np.testing.assert_allclose(got, plain, atol=1e-9)


def test_a_missing_marker_is_left_out_and_widens_the_uncertainty(hands):
    X, Y = hands
    Q = X[500:].copy()
    Q[::2, 1] = np.nan
    got = predict(Regression(), X[:500], Y[:500], Q)
    without = [0, 2, 3, 4, 5]
    expected = predict(Regression(), X[:500, without], Y[:500], X[500:, without])
    np.testing.assert_allclose(got.mean[::2], expected.mean[::2], atol=1e-12)
    whole = predict(Regression(), X[:500], Y[:500], X[500:])
    index_finger = slice(4, 8)
    assert got.std[::2, index_finger].mean() > 1.2 * whole.std[::2, index_finger].mean()
    np.testing.assert_allclose(got.std[1::2], whole.std[1::2], rtol=1e-9)


def test_no_marker_is_no_answer(hands):
    X, Y = hands
    Q = np.full((2, *X.shape[1:]), np.nan)
    assert np.isnan(predict(Regression(), X, Y, Q).mean).all()
    empty = X.copy()
    empty[:, 0] = np.nan
    with pytest.raises(InputError, match="no frame of the data base"):
        predict(Regression(), empty, Y, X[:1])


def test_ridge_damps_noise_in_an_ill_conditioned_data_base():
    rng = np.random.default_rng(2)
    truth = rng.normal(0, 30, (400, 1))
    X = (truth[:, :, None] * [[1.0, 1.0, 0.0]]) + rng.normal(0, 0.01, (400, 1, 3))
    y = truth + 100 * X[:, 0, 2:]  # what moves by 0.01 mm moves the answer by 1
    Q = X[300:] + rng.normal(0, 1.0, (100, 1, 3))
    plain = predict(Regression(), X[:300], y[:300], Q).mean
    damped = predict(Regression(ridge_mm=1.0), X[:300], y[:300], Q).mean
    assert abs(damped - y[300:]).mean() < 0.1 * abs(plain - y[300:]).mean()


def test_negative_settings_are_refused():
    with pytest.raises(InputError, match="negative"):
        Regression(neighbours=-1)
