"""Where the palm has faced of late."""

import numpy as np

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


def test_a_hand_that_may_be_anywhere_is_not_pulled(method: RefinedMethod, truth) -> None:
    from handtrack.estimate import Estimate

    estimate = Estimate(*truth, np.full(20, 0.1))
    method.restart(estimate, sure=True)
    near, loose = method.prior(estimate), method.prior(estimate, loose=4.0)
    method.restart(estimate)  # the fixture is shared
    assert near.facing_weight > 0
    assert loose.facing_weight == 0
