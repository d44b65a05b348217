"""Palm pose alone, beside OpenCV's planar solver on the same noisy points."""

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from handtrack.palm.orthographic import orthographic_pose
from handtrack.palm.planar import planar_pose
from handtrack.records import Pose

CAMERA = Camera.assumed_for(640, 480)
PLANE_MM = HandShape.default().palm_outline_mm
POINTS_MM = np.column_stack([PLANE_MM, np.zeros(len(PLANE_MM))])
POSES = 300


def random_pose(rng, tilt_max_rad):
    direction = rng.uniform(-np.pi, np.pi)
    tilt = rng.uniform(0, tilt_max_rad) * np.array([np.cos(direction), np.sin(direction), 0])
    R = rotation.exp(tilt) @ rotation.about_z(rng.uniform(-np.pi, np.pi)) @ np.diag([1.0, -1, -1])
    return Pose(R, np.array([*rng.uniform(-80, 80, 2), rng.uniform(350, 550)]))


def ippe(images_px):
    """Both of OpenCV's poses, lower reprojection error first."""
    _, turns, shifts, error = cv2.solvePnPGeneric(
        POINTS_MM, images_px, CAMERA.matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    order = np.argsort(np.ravel(error))
    return [Pose(rotation.exp(np.ravel(turns[i])), np.ravel(shifts[i])) for i in order]


@pytest.mark.parametrize(("noise_px", "tilt_max_deg"), [(1.0, 60), (1.0, 10), (0.3, 60)])
def test_median_error_is_no_larger_than_ippes(noise_px, tilt_max_deg):
    rng = np.random.default_rng(0)
    errors = {"ours": [], "IPPE": [], "orthographic": []}
    right = {"ours": [], "IPPE": []}
    for _ in range(POSES):
        truth = random_pose(rng, np.radians(tilt_max_deg))
        images = CAMERA.project(truth @ POINTS_MM) + rng.normal(0, noise_px, PLANE_MM.shape)
        found = {
            "ours": planar_pose(PLANE_MM, images, CAMERA).poses,
            "IPPE": ippe(images),
            "orthographic": orthographic_pose(PLANE_MM, images, CAMERA, line_of_sight=True).poses,
        }
        for name, poses in found.items():
            turns = [np.degrees(rotation.angle_between(pose.R, truth.R)) for pose in poses]
            errors[name].append(min(turns))  # of the two tilts, the true one
            if name in right:
                right[name].append(turns[0] <= min(turns) + 0.5)
    median = {name: np.median(values) for name, values in errors.items()}
    share = {name: np.mean(values) for name, values in right.items()}
    print(
        f"\n{noise_px} px, tilt up to {tilt_max_deg} deg: median rotation error (true tilt) "
        + ", ".join(f"{name} {value:.2f} deg" for name, value in median.items())
        + f"; ratio to IPPE {median['ours'] / median['IPPE']:.2f}; right tilt first: "
        + ", ".join(f"{name} {value:.0%}" for name, value in share.items())
    )
    assert median["ours"] <= 1.02 * median["IPPE"]
    assert share["ours"] >= share["IPPE"] - 0.02


@pytest.mark.parametrize("tilt_rad", [0.0, 1e-7, 1e-4, 0.3, 1.2])
def test_exact_points(tilt_rad):
    rng = np.random.default_rng(1)
    for _ in range(20):
        truth = random_pose(rng, 0)
        truth = Pose(rotation.exp([tilt_rad, 0, 0]) @ truth.R, truth.t_mm)
        result = planar_pose(PLANE_MM, CAMERA.project(truth @ POINTS_MM), CAMERA)
        assert result.status.usable
        assert np.abs(result.poses[0].R - truth.R).max() < 1e-5
        assert np.allclose(result.poses[0].t_mm, truth.t_mm, atol=1e-3)
        assert list(result.costs) == sorted(result.costs)


def test_degenerate_points_are_a_status():
    line = np.column_stack([np.arange(5.0), np.arange(5.0)])
    result = planar_pose(line, line, CAMERA)
    assert not result.status.usable
    assert result.poses == ()
