"""Sweeps: what is proposed, and that they leave a local minimum that refinement cannot."""

import numpy as np

from handtrack.estimate import Estimate
from handtrack.hand.skeleton import LIMITS
from handtrack.refine.sweep import (
    HOPELESS,
    SweepSettings,
    digit_energies,
    propose,
    stratified,
    sweep,
)
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, effective_samples


def test_stratified_samples_fill_every_slice() -> None:
    u = stratified(50, 2, np.random.default_rng(0))
    for axis in range(2):
        assert sorted((u[:, axis] * 50).astype(int)) == list(range(50))


def test_candidates_respect_the_limits_and_reach_both_ends(method: RefinedMethod) -> None:
    rng = np.random.default_rng(1)
    candidates = propose(np.zeros(20), 1, method.lines[1], SweepSettings(samples=200), rng)
    assert candidates.shape == (200, 4)
    assert (candidates >= LIMITS[4:8, 0] - 1e-12).all()
    assert (candidates <= LIMITS[4:8, 1] + 1e-12).all()
    assert np.ptp(candidates[:, 2]) > np.radians(80)


def test_what_was_tried_is_the_hand_with_one_digit_changed(
    method: RefinedMethod, view: View, truth
) -> None:
    pose, theta = truth
    prior = method.prior(Estimate(pose, theta, np.full(20, 0.1)), loose=4.0)
    settings = SweepSettings()
    tried = np.full((5, settings.samples, 20), np.nan)
    best, energies = sweep(
        method.refiner, view, pose, theta, prior, method.lines, settings,
        np.random.default_rng(0), tried,
    )  # fmt: skip
    for d in range(5):
        others = np.delete(tried[d], np.s_[4 * d : 4 * d + 4], axis=1)
        assert (others == others[0]).all()
        mine = best[4 * d : 4 * d + 4]
        cheapest = tried[d, energies[d].argmin(), 4 * d : 4 * d + 4]
        assert np.array_equal(mine, cheapest) or np.array_equal(mine, theta[4 * d : 4 * d + 4])


def test_a_sweep_finds_a_finger_that_refinement_does_not(
    method: RefinedMethod, view: View, truth
) -> None:
    pose, theta = truth
    wrong = theta.copy()
    wrong[8:12] = np.radians([85.0, 0.0, 100.0, 60.0])  # the middle one is thought to be a fist's
    prior = method.prior(Estimate(pose, wrong, np.full(20, 0.1)), loose=4.0)
    stuck = method.refiner(view, pose, wrong, prior, 20)
    swept, energies = sweep(
        method.refiner, view, pose, wrong, prior, method.lines, SweepSettings(),
        np.random.default_rng(0),
    )  # fmt: skip
    after = method.refiner(view, pose, swept, prior, 20)
    assert after.energy < stuck.energy
    assert np.degrees(np.abs(after.theta[8:12] - theta[8:12])).mean() < 15
    assert energies.shape == (5, SweepSettings().samples)


def test_only_hopeless_candidates_are_given_up(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    wrong = theta.copy()
    wrong[8:12] = np.radians([85.0, 0.0, 100.0, 60.0])
    prior = method.prior(Estimate(pose, wrong, np.full(20, 0.1)), loose=4.0)
    refiner = method.refiner
    off = np.random.default_rng(2).normal(size=(60, 4)) * np.linspace(0, 0.6, 60)[:, None]
    candidates = theta[8:12] + off  # from the truth to far from it

    def energies(some: np.ndarray) -> np.ndarray:
        return digit_energies(
            2, some, wrong, np.array(pose.R), np.array(pose.t_mm), refiner.sizes, refiner.parts,
            refiner.contour(view, pose), refiner.inner(view, pose), view.maps, view.intrinsics,
            refiner.settings.weights(view.doubt), prior.arrays, refiner.limits, np.radians(3.0),
        )[1]  # fmt: skip

    together = energies(candidates)
    alone = np.array([energies(candidates[k : k + 1])[0] for k in range(len(candidates))])
    hopeless = alone > together.min() + HOPELESS
    assert 5 < hopeless.sum() < 55
    np.testing.assert_array_equal(together[~hopeless], alone[~hopeless])
    assert (together[hopeless] > together.min() + HOPELESS).all()
    assert (together[hopeless] <= alone[hopeless]).all()
    assert (together[hopeless] < alone[hopeless]).any()


def test_effective_samples_of_equal_and_of_one_sided_energies() -> None:
    assert abs(effective_samples(np.zeros((5, 40))) - 40) < 1e-9
    one = np.full((5, 40), 1e4)
    one[:, 3] = 0
    assert abs(effective_samples(one) - 1) < 1e-9
