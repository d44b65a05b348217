"""The analytic Jacobian by finite differences, and the refinement by closed-form truth."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.perspective import PosePrior, projection_jacobian, refine
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose

CAMERA = Camera(580.0, 560.0, 322.0, 238.0, 640, 480)


def moved(pose, step):
    return Pose(rotation.exp(step[:3]) @ pose.R, pose.t_mm + step[3:])


def random_case(rng, n=12):
    points = rng.normal(0, 40, (n, 3)) * [1, 1, 0.3]
    pose = Pose(rotation.exp(rng.normal(0, 0.6, 3)), np.array([*rng.uniform(-80, 80, 2), 450.0]))
    return points, pose


def test_jacobian_by_finite_differences():
    rng = np.random.default_rng(0)
    points, pose = random_case(rng)
    pixels, J = projection_jacobian(points, pose, CAMERA)
    assert np.allclose(pixels, CAMERA.project(pose @ points))
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-5
        ahead, behind = moved(pose, step) @ points, moved(pose, -step) @ points
        numeric = (CAMERA.project(ahead) - CAMERA.project(behind)) / 2e-5
        assert np.allclose(J[..., i], numeric, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("along", [1.0, 0.3, 0.0])
def test_gradient_and_information_by_finite_differences(along):
    """At the minimum of a noisy problem with weights, normals and a prior."""
    rng = np.random.default_rng(1)
    points, truth = random_case(rng)
    images = CAMERA.project(truth @ points) + rng.normal(0, 2, (12, 2))
    weights, angle = rng.uniform(0.2, 2, 12), rng.uniform(-np.pi, np.pi, 12)
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    before = moved(truth, rng.normal(0, 0.05, 6) * [1, 1, 1, 100, 100, 100])
    prior = PosePrior(before, 0.1, 10.0)

    def cost(pose):
        e = CAMERA.project(pose @ points) - images
        across = np.sum(e * normals, axis=1) ** 2
        data = along * np.sum(e**2, axis=1) + (1 - along) * across
        turn = rotation.log(pose.R @ before.R.T) / 0.1
        shift = (pose.t_mm - before.t_mm) / 10.0
        return (weights @ data + turn @ turn + shift @ shift) / 2

    fit = refine(points, images, truth, CAMERA, weights, normals, along, prior)
    assert fit.converged
    assert fit.cost == pytest.approx(cost(fit.pose))
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-4 if i < 3 else 1e-2
        slope = (cost(moved(fit.pose, step)) - cost(moved(fit.pose, -step))) / (2 * step[i])
        curve = cost(moved(fit.pose, step)) + cost(moved(fit.pose, -step)) - 2 * fit.cost
        assert abs(slope) < 1e-4 * np.sqrt(fit.information[i, i])
        assert curve / step[i] ** 2 == pytest.approx(fit.information[i, i], rel=0.1)


@pytest.mark.parametrize("flat", [False, True])
def test_exact_points_give_the_exact_pose(flat):
    rng = np.random.default_rng(2)
    for _ in range(30):
        points, truth = random_case(rng)
        points[:, 2] *= not flat
        start = moved(truth, rng.normal(0, 1, 6) * [0.15, 0.15, 0.15, 15, 15, 30])
        fit = refine(points, CAMERA.project(truth @ points), start, CAMERA)
        tilted = flat and rotation.angle_between(fit.pose.R, truth.R) > 0.05
        if not tilted:  # a plane's other tilt is a local minimum of its own
            assert fit.status is PalmStatus.CONVERGED
            assert np.allclose(fit.pose.R, truth.R, atol=1e-7)
            assert np.allclose(fit.pose.t_mm, truth.t_mm, atol=1e-4)


def test_same_minimum_as_scipy():
    rng = np.random.default_rng(3)
    points, truth = random_case(rng)
    images = CAMERA.project(truth @ points) + rng.normal(0, 1, (12, 2))

    def residuals(v):
        pose = Pose(rotation.exp(v[:3]), v[3:])
        return (CAMERA.project(pose @ points) - images).ravel()

    start = np.concatenate([rotation.log(truth.R), truth.t_mm])
    theirs = least_squares(residuals, start, x_scale=[1, 1, 1, 100, 100, 100], xtol=1e-14)
    ours = refine(points, images, truth, CAMERA)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-9)
    assert np.allclose(ours.pose.R, rotation.exp(theirs.x[:3]), atol=1e-5)


def test_information_predicts_the_scatter():
    rng = np.random.default_rng(4)
    points, truth = random_case(rng, 20)
    exact, steps = CAMERA.project(truth @ points), []
    for _ in range(400):
        fit = refine(
            points, exact + rng.normal(0, 0.5, exact.shape), truth, CAMERA, np.full(20, 4.0)
        )
        steps.append([*rotation.log(fit.pose.R @ truth.R.T), *(fit.pose.t_mm - truth.t_mm)])
    predicted = np.sqrt(np.diag(np.linalg.inv(fit.information)))
    assert np.allclose(np.std(steps, axis=0), predicted, rtol=0.15)


def test_ends_that_are_not_poses():
    points, truth = random_case(np.random.default_rng(5))
    images = CAMERA.project(truth @ points)
    behind = Pose(truth.R, np.array([0.0, 0, -300]))
    assert refine(points, images, behind, CAMERA).status is PalmStatus.BEHIND_CAMERA
    assert refine(points[:2], images[:2], truth, CAMERA).status is PalmStatus.TOO_FEW_POINTS
    unknown = Pose(truth.R, np.full(3, np.nan))
    assert refine(points, images, unknown, CAMERA).status is PalmStatus.BAD_START
    assert refine(points, images * np.nan, truth, CAMERA).status is PalmStatus.TOO_FEW_POINTS
    short = refine(points, images + 40, truth, CAMERA, max_steps=1)
    assert short.status is PalmStatus.ROUND_LIMIT
    assert not short.converged
    with pytest.raises(InputError, match="go together"):
        refine(points, images[:3], truth, CAMERA)


def test_prior_alone_holds_what_the_points_leave_free():
    points, truth = random_case(np.random.default_rng(6))
    prior = PosePrior(truth, 0.1, 10.0)
    start = moved(truth, np.array([0.05, 0, 0, 3, 0, 0]))
    fit = refine(points[:1], CAMERA.project(truth @ points[:1]), start, CAMERA, prior=prior)
    assert np.allclose(fit.pose.R, truth.R, atol=1e-6)
