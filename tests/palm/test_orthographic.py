"""Closed-form truth: exact points of random planes, frontal and nearly frontal ones included."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.orthographic import orthographic_pose, other_tilt, sight_rotation, tilts_of
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose

CAMERA = Camera(580.0, 575.0, 322.0, 238.0, 640, 480)
TILTS_RAD = (0.0, 1e-12, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 0.1, 0.7, 1.4, np.pi / 2 - 1e-3)
PLANE_MM = np.array([[24, -4], [35, 50], [28, 98], [0, 101], [-42, 80], [-46, 66], [-30, 6.0]])


def tilted(rng, tilt_rad, back=False):
    """A rotation whose z column makes ``tilt_rad`` with the line of sight."""
    about, direction, roll = rng.uniform(-np.pi, np.pi, 3)
    R = rotation.about_z(about) @ rotation.exp(
        tilt_rad * np.array([np.cos(direction), np.sin(direction), 0])
    )
    return R @ rotation.about_z(roll) @ (rotation.about_y(np.pi) if back else np.eye(3))


def scaled_orthographic(R, t_mm, centre_mm, plane_mm, camera):
    """Exact image: all points at the depth of ``centre_mm``."""
    points = np.column_stack([plane_mm, np.zeros(len(plane_mm))]) @ R.T + t_mm
    t3 = (R @ [*centre_mm, 0] + t_mm)[2]
    pixels = points[:, :2] / t3 * (camera.fx_px, camera.fy_px) + (camera.cx_px, camera.cy_px)
    return pixels, t3


@pytest.mark.parametrize("tilt_rad", TILTS_RAD)
@pytest.mark.parametrize("back", [False, True])
def test_exact_points_give_rotation_and_depth(tilt_rad, back):
    rng = np.random.default_rng(1)
    for _ in range(50):
        R = tilted(rng, tilt_rad, back)
        t_mm = np.array([*rng.uniform(-100, 100, 2), rng.uniform(250, 900)])
        weights = rng.uniform(0.1, 2, len(PLANE_MM))
        centre = np.average(PLANE_MM, axis=0, weights=weights)
        pixels, t3 = scaled_orthographic(R, t_mm, centre, PLANE_MM, CAMERA)
        result = orthographic_pose(PLANE_MM, pixels, CAMERA, weights)
        assert result.status is PalmStatus.CONVERGED
        errors = [np.abs(pose.R - R).max() for pose in result.poses]
        best = result.poses[int(np.argmin(errors))]
        assert min(errors) < 1e-6
        assert np.allclose(best.t_mm, t_mm, rtol=0, atol=1e-6 * t3)
        assert abs((best @ np.append(centre, 0))[2] / t3 - 1) < 1e-9
        assert abs(result.tilt_rad - tilt_rad) < 1e-6
        for pose in result.poses:
            assert np.allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(pose.R) > 0
            again, _ = scaled_orthographic(pose.R, pose.t_mm, centre, PLANE_MM, CAMERA)
            assert np.allclose(again, pixels, atol=1e-8)


def test_the_two_tilts_differ_only_in_the_signs_of_r31_and_r32():
    R = tilted(np.random.default_rng(2), 0.5)
    (a, b), _ = tilts_of(R[:2, :2] / 400)
    assert np.allclose(a[2, :2], -b[2, :2])
    assert np.allclose(a[:2, :2], b[:2, :2])
    assert abs(a[2, 0]) > 1e-3


def test_closed_form_is_the_quartics_root():
    rng = np.random.default_rng(3)
    B = rng.normal(size=(200, 2, 2)) / 500
    tilts, t3 = tilts_of(B)
    G = np.swapaxes(B, 1, 2) @ B
    g11, g12, g22 = G[:, 0, 0], G[:, 0, 1], G[:, 1, 1]
    for k in range(len(B)):
        det = g11[k] * g22[k] - g12[k] ** 2
        quadratic = [det, -(g11[k] * g22[k] - 2 * g12[k] ** 2 - g11[k] ** 2), -(g12[k] ** 2)]
        root = max(np.roots(quadratic).real)
        assert np.isclose(tilts[k, 0, 2, 0] ** 2, root, rtol=1e-7)  # (14)
    assert np.allclose(t3**2 * g11 + tilts[:, 0, 2, 0] ** 2, 1)  # (12)
    assert np.allclose(t3**2 * g12 + tilts[:, 0, 2, 0] * tilts[:, 0, 2, 1], 0, atol=1e-12)  # (13)


@pytest.mark.parametrize("B", [np.diag([2e-3, 1e-3]), np.diag([1e-3, 2e-3]), np.diag([1e-3, 0])])
def test_axes_aligned_tilts_where_equation_13_is_zero_over_zero(B):
    tilts, t3 = tilts_of(B)
    assert np.allclose(tilts @ np.swapaxes(tilts, 1, 2), np.eye(3))
    assert np.allclose(tilts[:, :2, :2], B * t3)


def test_line_of_sight_beats_the_optical_axis_beside_it():
    rng = np.random.default_rng(4)
    errors = {True: [], False: []}
    for _ in range(100):
        pose = Pose(tilted(rng, rng.uniform(0.2, 0.8)), np.array([150.0, 90.0, 500.0]))
        pixels = CAMERA.project(pose @ np.column_stack([PLANE_MM, np.zeros(len(PLANE_MM))]))
        for sight, kept in errors.items():
            poses = orthographic_pose(PLANE_MM, pixels, CAMERA, line_of_sight=sight).poses
            kept.append(min(rotation.angle_between(p.R, pose.R) for p in poses))
    assert np.median(errors[True]) < 0.6 * np.median(errors[False])


def test_other_tilt_is_an_involution_that_keeps_the_centre_and_its_image():
    rng = np.random.default_rng(5)
    for _ in range(20):
        pose = Pose(tilted(rng, 0.6), np.array([90.0, -60.0, 450.0]))
        centre = np.array([0.0, 45.0, 0.0])
        other = other_tilt(pose, centre)
        assert np.allclose(other @ centre, pose @ centre)
        assert np.isclose(np.linalg.det(other.R), 1)
        assert rotation.angle_between(other.R, pose.R) > 0.1
        near = centre + np.column_stack([rng.normal(size=(9, 2)), np.zeros(9)])
        assert np.allclose(CAMERA.project(other @ near), CAMERA.project(pose @ near), atol=0.03)
        back = other_tilt(other, centre)
        assert np.allclose(back.R, pose.R)
        assert np.allclose(back.t_mm, pose.t_mm)


def test_sight_rotation_takes_the_direction_to_z():
    for direction in ([0, 0, 2], [1, -2, 3], [1e-9, 0, 1]):
        R = sight_rotation(direction)
        assert np.allclose(R @ direction, [0, 0, np.linalg.norm(direction)])


def test_degenerate_points_are_a_status():
    line = np.column_stack([np.arange(5.0), 2 * np.arange(5.0)])
    cases = {
        "line": (line, line, None, PalmStatus.COLLINEAR),
        "two": (PLANE_MM[:2], PLANE_MM[:2], None, PalmStatus.TOO_FEW_POINTS),
        "none": (np.empty((0, 2)), np.empty((0, 2)), None, PalmStatus.TOO_FEW_POINTS),
        "no weight": (PLANE_MM, PLANE_MM, np.zeros(7), PalmStatus.TOO_FEW_POINTS),
        "unseen": (PLANE_MM, np.full((7, 2), np.nan), None, PalmStatus.TOO_FEW_POINTS),
        "one image": (PLANE_MM, np.full((7, 2), 3.0), None, PalmStatus.COLLINEAR),
    }
    for name, (plane, pixels, weights, status) in cases.items():
        result = orthographic_pose(plane, pixels, CAMERA, weights)
        assert result.status is status, name
        assert result.poses == (), name
        assert not result.status.usable
        assert len(result.status.sentence) > 20


def test_bad_shapes_and_weights_are_refused():
    for weights in (np.ones(3), -np.ones(7), np.full(7, np.nan)):
        with pytest.raises(InputError, match="weights"):
            orthographic_pose(PLANE_MM, PLANE_MM, CAMERA, weights)
    with pytest.raises(InputError, match="wanted"):
        orthographic_pose(PLANE_MM, PLANE_MM[:3], CAMERA)
