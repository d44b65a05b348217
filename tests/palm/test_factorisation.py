"""Exact planes in several frames: known plane, unknown plane, and what cannot be told."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.factorisation import factorise
from handtrack.palm.status import PalmStatus

CAMERA = Camera(580.0, 575.0, 322.0, 238.0, 640, 480)
FOCAL_PX, PRINCIPAL_PX = np.array([580.0, 575.0]), np.array([322.0, 238.0])
PLANE_MM = np.array([[24, -4], [35, 50], [28, 98], [0, 101], [-42, 80], [-46, 66], [-30, 6.0]])


def seen(R, t_mm, plane_mm=PLANE_MM):
    """Exact scaled-orthographic images ``(F, n, 2)`` about the centroid, and its depths."""
    points = np.column_stack([plane_mm, np.zeros(len(plane_mm))])
    cam = points @ np.swapaxes(R, -1, -2) + t_mm[:, None]
    t3 = cam[..., 2].mean(axis=1)
    pixels = cam[..., :2] / t3[:, None, None] * FOCAL_PX
    return pixels + PRINCIPAL_PX, t3


def at_depth(R, depth_mm):
    """Origins of the palm that put the plane's centroid at ``depth_mm``."""
    centre = R @ np.append(PLANE_MM.mean(axis=0), 0)
    return np.array([0, 0, depth_mm]) - centre


@pytest.mark.parametrize("tilt_rad", [0.0, 1e-8, 1e-5, 1e-4, 1e-2, 0.5, 1.2])
@pytest.mark.parametrize("n_frames", [1, 2, 10])
def test_known_plane_gives_every_pose(tilt_rad, n_frames):
    rng = np.random.default_rng(n_frames)
    roll, direction = rng.uniform(-np.pi, np.pi, (2, n_frames))
    lean = np.column_stack([np.cos(direction), np.sin(direction), np.zeros(n_frames)])
    R = rotation.exp(tilt_rad * lean) @ rotation.about_z(roll)
    t_mm = np.column_stack([rng.uniform(-90, 90, (n_frames, 2)), rng.uniform(300, 800, n_frames)])
    pixels, t3 = seen(R, t_mm)
    result = factorise(pixels, CAMERA, plane_mm=PLANE_MM)
    assert result.status is PalmStatus.CONVERGED
    assert np.allclose(result.plane_mm, PLANE_MM, atol=1e-9)
    for f, frame in enumerate(result.frames):
        errors = [np.abs(pose.R - R[f]).max() for pose in frame.poses]
        assert min(errors) < 1e-6
        assert np.allclose(frame.poses[np.argmin(errors)].t_mm, t_mm[f], atol=1e-6 * t3[f])


def test_a_drifting_plane_is_corrected_by_rank_two():
    """Points that sit wrongly on the model, the same way in all frames, are put right."""
    rng = np.random.default_rng(7)
    R = rotation.exp(rng.normal(0, 0.5, (12, 3)))
    pixels, _ = seen(R, at_depth(R, 500))
    wrong = PLANE_MM + rng.normal(0, 2, PLANE_MM.shape)
    result = factorise(pixels, CAMERA, plane_mm=wrong)
    assert result.rms_px < 1e-9
    shape = PLANE_MM - PLANE_MM.mean(axis=0)

    def misshape(p):  # what no affine map explains
        p = p - p.mean(axis=0)
        return np.abs(p - shape @ np.linalg.lstsq(shape, p, rcond=None)[0]).max()

    assert misshape(wrong) > 1
    assert misshape(result.plane_mm) < 1e-9


@pytest.mark.parametrize("n_frames", [3, 4, 9])
def test_unknown_plane_at_known_depths(n_frames):
    rng = np.random.default_rng(n_frames)
    both = 0
    for _ in range(20):
        R = rotation.exp(rng.normal(0, 0.6, (n_frames, 3)))
        t3 = rng.uniform(400, 700, n_frames)
        pixels, _ = seen(R, np.stack([at_depth(R[f], t3[f]) for f in range(n_frames)]))
        result = factorise(pixels, CAMERA, depths_mm=t3)
        assert result.status.usable, result.status.sentence
        both += result.status is PalmStatus.TWO_PLANES
        assert len(result.others) == (result.status is PalmStatus.TWO_PLANES)
        distances = np.linalg.norm(PLANE_MM[:, None] - PLANE_MM, axis=-1)
        fits = []
        for plane in (result, *result.others):
            found = np.linalg.norm(plane.plane_mm[:, None] - plane.plane_mm, axis=-1)
            fits.append(np.abs(found - distances).max())
            for frame, pixel, depth in zip(plane.frames, pixels, t3, strict=True):
                points = np.column_stack([plane.plane_mm, np.zeros(len(PLANE_MM))])
                for pose in frame.poses:
                    cam = pose @ points
                    assert np.isclose(cam[:, 2].mean(), depth, rtol=1e-5)
                    again = cam[:, :2] / depth * FOCAL_PX
                    assert np.allclose(again + PRINCIPAL_PX, pixel, atol=1e-2)
        assert min(fits) < 1e-4
    assert both == 0 if n_frames > 3 else both > 0  # three frames can leave two planes


def test_common_factor_of_the_depths_is_the_size():
    R = rotation.exp(np.random.default_rng(3).normal(0, 0.6, (6, 3)))
    pixels, _ = seen(R, at_depth(R, 500))
    one, two = (factorise(pixels, CAMERA, depths_mm=d).plane_mm for d in (500, 1000))
    assert np.allclose(two, 2 * one)


def test_noisy_unknown_plane_is_near_the_truth():
    rng = np.random.default_rng(5)
    R = rotation.exp(rng.normal(0, 0.6, (40, 3)))
    pixels, _ = seen(R, at_depth(R, 500))
    result = factorise(pixels + rng.normal(0, 0.5, pixels.shape), CAMERA, depths_mm=500)
    distances = np.linalg.norm(PLANE_MM[:, None] - PLANE_MM, axis=-1)
    found = np.linalg.norm(result.plane_mm[:, None] - result.plane_mm, axis=-1)
    assert result.status is PalmStatus.CONVERGED
    assert np.abs(found - distances).max() < 0.05 * distances.max()
    assert 0.3 < result.rms_px < 0.6


def test_what_cannot_be_told_is_a_status():
    rolls = rotation.about_z(np.linspace(0, 2, 6))
    one_axis = rotation.about_y(np.linspace(0.1, 1, 6))
    turned = rotation.exp(np.random.default_rng(1).normal(0, 0.6, (6, 3)))

    def status(R, **known):
        return factorise(seen(R, at_depth(R, 500))[0], CAMERA, **known).status

    assert status(rolls, depths_mm=500) is PalmStatus.NOT_TURNED  # all frontal
    assert status(rolls, plane_mm=PLANE_MM) is PalmStatus.CONVERGED
    assert status(one_axis, depths_mm=500) is PalmStatus.NOT_TURNED
    assert status(turned[:2], depths_mm=500) is PalmStatus.TOO_FEW_FRAMES
    assert status(turned, depths_mm=[500, 100, 500, 900, 500, 500]) is PalmStatus.NOT_A_PLANE
    line = np.repeat(PLANE_MM[:1], 7, axis=0) * np.arange(7)[:, None]
    assert factorise(line[None], CAMERA, plane_mm=PLANE_MM).status is PalmStatus.COLLINEAR
    assert factorise(PLANE_MM[None], CAMERA, plane_mm=line).status is PalmStatus.COLLINEAR
    two = factorise(PLANE_MM[None, :2], CAMERA, plane_mm=PLANE_MM[:2])
    assert two.status in (PalmStatus.TOO_FEW_POINTS, PalmStatus.COLLINEAR)
    assert two.frames == ()


def test_bad_input_is_refused():
    good = np.stack([PLANE_MM] * 3)
    with pytest.raises(InputError, match="depths_mm"):
        factorise(good, CAMERA)
    with pytest.raises(InputError, match="positive"):
        factorise(good, CAMERA, depths_mm=[1, -1, 1])
    with pytest.raises(InputError, match="finite"):
        factorise(good * np.nan, CAMERA, depths_mm=1)
    with pytest.raises(InputError, match="shape"):
        factorise(PLANE_MM, CAMERA, depths_mm=1)
    with pytest.raises(InputError, match="like the points"):
        factorise(good, CAMERA, plane_mm=PLANE_MM[:4])
