"""Where the palm has faced of late."""

import numpy as np

from handtrack.estimate import Estimate
from handtrack.proposer.network import Hypotheses
from handtrack.refine.facing import Facing
from handtrack.refined import RefinedMethod

FRONT = np.array([0.0, 0.0, -1.0])


def test_a_guess_counts_for_nothing_until_it_has_been_watched() -> None:
    facing = Facing(frames=10)
    facing.begin(np.array([1.0, 0.0, 0.0]))
    assert facing.weight == 0
    for _ in range(10):
        facing.watch(FRONT)
    assert facing.weight == 1
    np.testing.assert_allclose(facing.normal, FRONT, atol=1e-12)  # the guess is forgotten


def test_a_palm_found_where_it_faced_keeps_its_past_and_another_does_not() -> None:
    facing = Facing(frames=10)
    facing.begin(FRONT, known=True)
    facing.begin(np.array([np.sin(0.1), 0.0, -np.cos(0.1)]))
    assert facing.weight == 1
    np.testing.assert_array_equal(facing.normal, FRONT)
    facing.begin(np.array([np.sin(0.5), 0.0, -np.cos(0.5)]))
    assert facing.weight == 0


def test_the_mean_follows_a_turn_slowly() -> None:
    facing = Facing(frames=30)
    facing.begin(FRONT, known=True)
    turned = np.array([0.6, 0.0, -0.8])
    for _ in range(30):
        facing.watch(turned)
    gone = facing.normal @ turned
    assert FRONT @ turned < gone < 1
    assert abs(np.linalg.norm(facing.normal) - 1) < 1e-12


def test_what_is_told_stands_for_the_mean_until_the_hand_is_found_anew() -> None:
    facing = Facing(frames=10)
    facing.begin(FRONT, known=False)
    facing.told = np.array([0.6, 0.0, -0.8])
    assert facing.weight == 1
    np.testing.assert_array_equal(facing.normal, [0.6, 0.0, -0.8])
    facing.watch(FRONT)
    facing.told = None
    assert facing.weight == 0.1
    np.testing.assert_array_equal(facing.normal, FRONT)
    facing.told = np.array([0.6, 0.0, -0.8])
    facing.begin(FRONT)
    assert facing.told is None


def test_the_palm_is_told_of_where_the_outline_is_known_by_shape_alone(
    method: RefinedMethod, truth
) -> None:
    pose, theta = truth
    seen = Hypotheses(
        weight=np.ones(1), theta=theta[None], theta_std=np.full((1, 20), 0.1), R=pose.R[None],
        turn_std=np.full(1, 0.1), at_px=np.zeros((1, 2)), at_std_px=np.ones(1),
        palm_px=np.full(1, 70.0), size_std=np.full(1, 0.1),
    )  # fmt: skip
    predicted = Estimate(pose, theta, np.full(20, 0.1))
    method.restart(predicted)
    method.tell(seen, predicted, by_shape=False)
    assert method.facing.told is None
    by_colour = method.prior(predicted).told_weight
    method.tell(seen, predicted, by_shape=True)
    np.testing.assert_allclose(method.facing.told, pose.R[:, 2])
    np.testing.assert_array_less(by_colour, method.prior(predicted).told_weight)
    method.restart(predicted)
    assert method.facing.told is None
    assert not method.prior(predicted).told_weight.any()


def test_a_hand_that_may_be_anywhere_is_not_pulled(method: RefinedMethod, truth) -> None:
    estimate = Estimate(*truth, np.full(20, 0.1))
    method.restart(estimate, sure=True)
    near, loose = method.prior(estimate), method.prior(estimate, loose=4.0)
    method.restart(estimate)  # the fixture is shared
    assert near.facing_weight > 0
    assert loose.facing_weight == 0
