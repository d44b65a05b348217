"""The energy: its derivatives, its minimum, and that the evidence stops at the wrist."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.records import Pose
from handtrack.refine import prior as priors
from handtrack.refine import solve
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod


def terms(method: RefinedMethod, view: View, pose: Pose, theta: np.ndarray, prior: priors.Prior):
    """Energy of ``(w, v, theta)`` increments about a pose, and its half gradient there."""
    r = method.refiner
    fixed = (
        r.sizes, r.parts, r.contour(view, pose), r.inner(view, pose), view.maps,
        view.intrinsics, r.settings.weights(view.doubt), prior.arrays, r.limits, np.radians(3.0),
    )  # fmt: skip

    def energy(x: np.ndarray) -> float:
        R, t = rotation.exp(x[:3]) @ pose.R, pose.t_mm + x[3:6]
        none = np.empty((0, 0)), np.empty(0)
        return solve.total_energy(R, t, theta + x[6:], *fixed, *none)[1]

    H, g = np.zeros((26, 26)), np.zeros(26)
    solve.total_energy(np.array(pose.R), np.array(pose.t_mm), np.array(theta), *fixed, H, g)
    return energy, g, H


def test_prior_gradient_by_finite_differences(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    rng = np.random.default_rng(0)
    elsewhere = Estimate(pose, theta + 0.05 * rng.normal(size=20), np.full(20, 0.1))
    prior = replace(
        method.prior(elsewhere),
        facing=np.array([0.1, -0.05, -1.0]),
        facing_weight=90.0,
        told=theta + 0.1,
        told_weight=np.linspace(0.0, 40.0, 20),
    )
    shift = np.array([1.0, -2.0, 3.0])
    turned = Pose(rotation.exp([0.004, -0.003, 0.005]) @ pose.R, pose.t_mm + shift)
    blind = View(
        contour=np.empty((0, 2)), normal=np.empty((0, 2)), inner=np.empty((0, 5)), sdf=view.sdf,
        edge_strength=view.edge_strength, edge_x=view.edge_x, edge_y=view.edge_y,
        intrinsics=view.intrinsics, valid=np.zeros(4),
        grey=view.grey,
    )  # fmt: skip
    energy, g, _ = terms(method, blind, turned, theta, prior)
    step = 1e-5
    numeric = [(energy(step * e) - energy(-step * e)) / (4 * step) for e in np.eye(26)]
    np.testing.assert_allclose(g, numeric, rtol=2e-3, atol=2e-3)


def test_image_gradient_by_finite_differences(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    prior = method.prior(Estimate(pose, theta, np.full(20, 0.1)))
    near = Pose(rotation.exp([0.01, -0.01, 0.01]) @ pose.R, pose.t_mm + np.array([0.7, -0.5, 2.0]))
    energy, g, _ = terms(method, view, near, theta, prior)
    step = 1e-5
    numeric = np.array([(energy(step * e) - energy(-step * e)) / (4 * step) for e in np.eye(26)])
    # outline samples take their normal as fixed, so the gradient is close, not exact
    cosine = g @ numeric / np.linalg.norm(g) / np.linalg.norm(numeric)
    assert cosine > 0.995


def test_information_is_symmetric_and_positive(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    prior = method.prior(Estimate(pose, theta, np.full(20, 0.1)))
    _, _, H = terms(method, view, pose, theta, prior)
    np.testing.assert_allclose(H, H.T, atol=1e-9 * np.abs(H).max())
    assert np.linalg.eigvalsh(H).min() > 0


def test_contour_below_the_wrist_does_not_count(view: View, truth) -> None:
    pose, _ = truth
    weights = view.contour_weights(pose, 6.0)
    line = view.wrist_line(pose, 6.0)
    below = (view.contour - line[0]) @ line[1] < 0
    assert below.any()
    assert not weights[below].any()
    assert weights[~below].mean() > 0.95


def test_where_the_palm_has_faced_pulls_it_until_it_clearly_faces_elsewhere() -> None:
    none = np.empty((0, 0)), np.empty(0)
    facing, std = np.array([0.0, 0.0, -1.0]), np.radians(6.0)
    cost = [
        priors.facing_energy(rotation.about_x(np.radians(a)) @ facing, facing, std**-2, *none)
        for a in (0.0, 6.0, 30.0, 180.0)
    ]
    assert cost[0] == 0
    assert 0.7 < cost[1] < 1.0
    assert cost[2] < cost[3] < priors.FACING_TAIL < 1.2 * cost[2]


@pytest.mark.parametrize("seed", range(3))
def test_refinement_finds_the_pose_it_was_drawn_with(
    method: RefinedMethod, view: View, truth, seed: int
) -> None:
    pose, theta = truth
    rng = np.random.default_rng(seed)
    start = Pose(
        rotation.exp(0.05 * rng.normal(size=3)) @ pose.R, pose.t_mm + 4.0 * rng.normal(size=3)
    )
    bent = theta + 0.1 * rng.normal(size=20)
    prior = method.prior(Estimate(start, bent, np.full(20, 0.1)), loose=3.0)
    before = method.refiner(view, start, bent, prior, 0)
    after = method.refiner(view, start, bent, prior, 30)
    assert after.energy < 0.5 * before.energy
    off_mm = np.abs(after.pose.t_mm - pose.t_mm)
    assert off_mm[:2].max() < 3.0
    assert np.degrees(rotation.angle_between(after.pose.R, pose.R)) < 8.0
    assert np.degrees(np.abs(after.theta - theta).mean()) < 6.0


def test_a_fixed_part_stays(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    bent = theta + 0.1
    prior = method.prior(Estimate(pose, bent, np.full(20, 0.1)))
    palm = method.refiner(view, pose, bent, prior, 5, free="palm")
    np.testing.assert_array_equal(palm.theta, bent)
    fingers = method.refiner(view, pose, bent, prior, 5, free="fingers")
    np.testing.assert_allclose(fingers.pose.R, pose.R, atol=1e-12)


def test_a_doubtful_view_counts_for_less(method: RefinedMethod, view: View, truth) -> None:
    pose, theta = truth
    off = theta + 0.1
    prior = method.prior(Estimate(pose, theta, np.full(20, 0.1)), loose=4.0)
    image, whole = method.refiner.weigh(view, pose, off, prior)
    doubted = method.refiner.weigh(replace(view, doubt=2.0), pose, off, prior)
    assert doubted[0] == pytest.approx(image / 4)
    assert doubted[1] - doubted[0] == pytest.approx(whole - image)
