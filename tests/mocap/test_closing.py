"""The hand closes on its markers: what they fix is met, what they leave open stays."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.mocap import closing
from handtrack.mocap.regression import Regression
from handtrack.mocap.settings import Handover
from handtrack.mocap.validation import NINETY, held_out

TIPS, DIPS = [4, 8, 12, 16, 20], [3, 7, 11, 15, 19]
SPREAD = np.tile(np.eye(4) * 0.15**2, (5, 1, 1))


@pytest.fixture(scope="module")
def theta() -> np.ndarray:
    rng = np.random.default_rng(3)
    low, high = LIMITS[:, 0], LIMITS[:, 1]
    return low + (high - low) * np.clip(rng.normal(0.4, 0.2, (1500, 20)), 0, 1)


def keypoints(theta, which):
    return keypoints_mm(theta, HandShape.default())[:, which]


def test_derivatives_are_those_of_finite_differences(theta):
    t, step = theta[:20, 4:8], 1e-6
    f, slope = closing.functions(t)
    np.testing.assert_array_equal(f, closing.products(t))
    assert f.shape == (20, 81)
    for k in range(4):
        more = closing.functions(t + step * np.eye(4)[k])[0]
        less = closing.functions(t - step * np.eye(4)[k])[0]
        np.testing.assert_allclose(slope[k], (more - less) / (2 * step), atol=1e-8)


def test_kinematics_are_linear_in_the_functions(theta):
    forward = closing.fit(keypoints(theta, TIPS), theta)
    assert forward.digit.tolist() == [0, 1, 2, 3, 4]
    assert forward.miss_mm.max() < 0.05
    shuffled = closing.fit(keypoints(theta, [20, 4, 12]), theta)
    assert shuffled.digit.tolist() == [4, 0, 2]


def test_what_two_markers_fix_is_found_again(theta):
    X = keypoints(theta, DIPS + TIPS)
    forward = closing.fit(X[:1200], theta[:1200])
    start = theta[1200:] + np.random.default_rng(0).normal(0, 0.1, (300, 20))
    got = forward.close(X[1200:], start, SPREAD, 0.01)
    assert np.degrees(np.median(np.abs(got.theta - theta[1200:]))) < 0.1
    assert np.degrees(np.median(got.std)) < 0.5


def test_a_digit_without_markers_stays_and_far_markers_are_not_met(theta):
    X = keypoints(theta, [8])
    forward = closing.fit(X, theta)
    start = theta[:50] + 0.1
    got = forward.close(X[:50], start, SPREAD, 0.1)
    others = [k for k in range(20) if not 4 <= k < 8]
    np.testing.assert_array_equal(got.theta[:, others], start[:, others])
    np.testing.assert_allclose(got.std[:, others], 0.15, rtol=1e-9)
    unseen = forward.close(np.full_like(X[:50], np.nan), start, SPREAD, 0.1)
    np.testing.assert_allclose(unseen.theta, start, atol=1e-12)
    lazy = forward.close(X[:50], start, SPREAD, 1e6)
    np.testing.assert_allclose(lazy.theta, start, atol=1e-6)


def test_held_out_intervals_hold_and_closing_lowers_the_error(theta):
    X, fold = keypoints(theta, DIPS + TIPS)[:600], np.arange(600) // 150
    plain = held_out(Handover(Regression(ridge_mm=0.5)), X, theta[:600], fold)
    closed = held_out(Handover(Regression(ridge_mm=0.5), close_mm=0.1), X, theta[:600], fold)
    assert closed.error(theta[:600]) < 0.5 * plain.error(theta[:600])
    for held in (plain, closed):
        inside = np.abs(held.theta - theta[:600]) <= NINETY * held.factor(theta[:600]) * held.std
        np.testing.assert_allclose(inside.mean(axis=0), 0.9, atol=0.005)


def test_a_second_round_knows_how_joints_go_together(theta):
    """A ring finger that does what the middle one does: linear in angles, not in millimetres."""
    habit = theta[:600].copy()
    habit[:, 12:16] = habit[:, 8:12]
    X, fold = keypoints(habit, [10, 11, 12]), np.arange(600) // 150
    once = Handover(Regression(ridge_mm=0.5), close_mm=0.1)
    ring = [
        np.abs(held_out(replace(once, rounds=rounds), X, habit, fold).theta - habit)[:, 12:16]
        for rounds in (1, 2)
    ]
    assert ring[1].mean() < 0.5 * ring[0].mean()


def test_intervals_hold_after_two_rounds(theta):
    X, fold = keypoints(theta, TIPS)[:600], np.arange(600) // 150
    settings = Handover(Regression(ridge_mm=0.5), close_mm=0.1, borrow=50, rounds=2)
    held = held_out(settings, X, theta[:600], fold)
    assert held.theta.shape == held.std.shape == (600, 20)
    assert held.angles.shape == (650, 20)
    inside = np.abs(held.theta - theta[:600]) <= NINETY * held.factor(theta[:600]) * held.std
    np.testing.assert_allclose(inside.mean(axis=0), 0.9, atol=0.005)


@pytest.mark.parametrize(("rounds", "close_mm"), [(0, 0.2), (2, 0.0)])
def test_rounds_that_make_no_sense_are_refused(rounds, close_mm):
    with pytest.raises(InputError, match=f"{rounds} rounds"):
        Handover(rounds=rounds, close_mm=close_mm)
