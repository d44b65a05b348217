"""The camera: windows, mirror images, sizes, and its file."""

import numpy as np
import pytest

from handtrack.camera import Camera, Window
from handtrack.errors import InputError, OutputError

CAMERA = Camera(610.0, 600.0, 330.0, 235.0, 640, 480)
POINTS_MM = np.random.default_rng(0).normal([0, 0, 500], [80, 80, 40], (20, 3))


def test_matrix_projects_as_project_does():
    homogeneous = POINTS_MM @ CAMERA.matrix.T
    np.testing.assert_allclose(homogeneous[:, :2] / homogeneous[:, 2:], CAMERA.project(POINTS_MM))


def test_through_a_window_is_the_window_of_the_projection():
    window = Window(x_px=101.5, y_px=33.0, scale=0.4, width_px=90, height_px=70)
    np.testing.assert_allclose(
        CAMERA.through(window).project(POINTS_MM), window.to_window(CAMERA.project(POINTS_MM))
    )
    np.testing.assert_allclose(
        window.to_frame(window.to_window(POINTS_MM[:, :2])), POINTS_MM[:, :2]
    )


def test_mirrored_camera_sees_the_mirrored_world_in_the_flipped_image():
    flipped = CAMERA.mirrored().project(POINTS_MM * [-1, 1, 1])
    np.testing.assert_allclose(flipped[:, 0], 639 - CAMERA.project(POINTS_MM)[:, 0])
    assert CAMERA.mirrored().mirrored() == CAMERA


def test_another_size_scales_pixel_edges_not_centres():
    half = CAMERA.for_size(320, 240)
    expected = (CAMERA.project(POINTS_MM) + 0.5) / 2 - 0.5
    np.testing.assert_allclose(half.project(POINTS_MM), expected)


def test_another_shape_is_refused():
    with pytest.raises(InputError, match="another shape"):
        CAMERA.for_size(480, 640)


def test_file_round_trip(tmp_path):
    CAMERA.save(tmp_path / "camera.toml", source="a board of 9 x 6")
    assert Camera.load(tmp_path / "camera.toml") == CAMERA


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("fx_px", "focal", "unknown key focal"),
        ("fx_px = 610.0\n", "", "missing key fx_px"),
        ("610.0", "-1", "fx_px = -1"),
        ("610.0", "nan", "fx_px = nan"),
        ("610.0", '"wide"', "fx_px = 'wide'"),
        ("width_px = 640", "width_px = 640.5", "width_px = 640.5 is not a whole number"),
        ("version = 1", "version = 2", "version 2"),
        ("handtrack-camera", "handtrack-hand", "'handtrack-hand'"),
        ("=", "", "not a TOML file"),
    ],
)
def test_file_is_checked(old, new, says, tmp_path):
    path = tmp_path / "camera.toml"
    CAMERA.save(path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=says) as error:
        Camera.load(path)
    assert "camera.toml" in str(error.value)


def test_file_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        Camera.load(tmp_path / "none.toml")
    with pytest.raises(OutputError, match="cannot be written"):
        CAMERA.save(tmp_path / "no folder" / "camera.toml")
