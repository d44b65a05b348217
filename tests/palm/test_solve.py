"""The solvers of ICP: the likeliest pose under a prior, against a general minimiser."""

import numpy as np
import pytest
from scipy.optimize import minimize

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.palm.outline import Outline
from handtrack.palm.pairs import Pairs
from handtrack.palm.perspective import PosePrior
from handtrack.palm.solve import solve_orthographic
from handtrack.records import Pose

CAMERA = Camera(600.0, 600.0, 320.0, 240.0, 641, 481)
TURN_STD, SHIFT_STD_MM = 0.05, 10.0


def problem(seed: int) -> tuple[Pairs, Pose]:
    """Noisy images of a plane on the optical axis, and a pose beside the true one."""
    rng = np.random.default_rng(seed)
    P = np.column_stack([rng.uniform(-40, 40, (30, 2)), np.zeros(30)])
    P -= P.mean(axis=0)
    R = rotation.exp(rng.normal(0, 0.3, 3)) @ np.diag([1.0, -1.0, -1.0])
    images = (P @ R.T)[:, :2] / 420.0 * 600.0 + (320.0, 240.0) + rng.normal(0, 1, (30, 2))
    images -= images.mean(axis=0) - (320.0, 240.0)
    beside = rotation.exp(rng.normal(0, 0.1, 3)) @ R
    pairs = Pairs.of(P, images, np.ones(30), np.zeros((30, 2)), 1.0)
    return pairs, Pose(beside, np.array([0.0, 0.0, 425.0]))


def minimum(pairs: Pairs, before: Pose) -> Pose:
    """The pose of least squares and prior, found by a search that knows nothing of either."""

    def energy(z: np.ndarray) -> float:
        R, T = rotation.exp(z[:3]) @ before.R, before.t_mm + z[3:]
        seen = (pairs.points_mm @ R.T + T)[:, :2] / T[2] * 600.0 + (320.0, 240.0)
        off = np.sum((seen - pairs.images_px) ** 2)
        away = z / np.repeat([TURN_STD, SHIFT_STD_MM], 3)
        return float(0.5 * off + 0.5 * np.sum(away**2))

    z = minimize(energy, np.zeros(6), tol=1e-12).x
    return Pose(rotation.exp(z[:3]) @ before.R, before.t_mm + z[3:])


@pytest.mark.parametrize("seed", range(4))
def test_with_a_prior_the_likeliest_pose_is_found(seed: int) -> None:
    pairs, before = problem(seed)
    prior = PosePrior(before, TURN_STD, SHIFT_STD_MM)
    found = solve_orthographic(pairs, before, CAMERA, prior)
    assert found is not None
    wanted = minimum(pairs, before)
    assert np.degrees(rotation.angle_between(found[0].R, wanted.R)) < 0.01
    np.testing.assert_allclose(found[0].t_mm, wanted.t_mm, atol=0.01)
    free = solve_orthographic(pairs, before, CAMERA)
    assert free is not None  # and the prior did pull
    assert np.degrees(rotation.angle_between(found[0].R, free[0].R)) > 0.1


def test_a_prior_that_says_nothing_changes_nothing() -> None:
    pairs, before = problem(0)
    found, free = (
        solve_orthographic(pairs, before, CAMERA, prior)
        for prior in (PosePrior(before, 1e4, 1e7), None)
    )
    assert found is not None
    assert free is not None
    np.testing.assert_allclose(found[0].R, free[0].R, atol=1e-7)
    np.testing.assert_allclose(found[0].t_mm, free[0].t_mm, atol=1e-4)


def test_beside_the_axis_a_frontal_palm_is_found_frontal() -> None:
    """A camera that faces the palm sees no tilt in it, wherever in the image it is."""
    flat = np.array([[-40.0, -45, 0], [40, -45, 0], [40, 45, 0], [-40, 45, 0]])
    place = np.array([120.0, -60.0, 440.0])
    R = rotation.exp(np.array([0.2, 0.15, 0.0])) @ np.diag([1.0, -1.0, -1.0])
    truth = Pose(R, place)
    pairs = Pairs.of(flat, CAMERA.project(truth @ flat), np.ones(4), np.zeros((4, 2)), 1.0)
    found = solve_orthographic(pairs, truth, CAMERA)
    assert found is not None
    assert np.degrees(rotation.angle_between(found[0].R, R)) < 4


def test_normals_follow_tangents_that_leave_the_plane() -> None:
    """A side that goes away from the camera is seen along its own direction."""
    pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([30.0, 20.0, 400.0]))
    along = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    outline = Outline(np.array([[10.0, 80.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]), along[None])
    seen = outline.seen(pose, CAMERA)
    assert seen is not None
    ends = CAMERA.project(pose @ (outline.points_mm + np.outer([-0.01, 0.01], along)))
    direction = ends[1] - ends[0]
    assert abs(seen[1][0] @ direction) < 1e-4 * np.linalg.norm(direction)
    assert seen[1][0, 0] > 0  # outwards
