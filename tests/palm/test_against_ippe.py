"""Palm pose alone, beside OpenCV's planar solver on the same noisy points."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.palm import BenchPalm, compare_palm, random_pose
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.palm.planar import planar_pose
from handtrack.records import Pose

CAMERA = Camera.assumed_for(640, 480)
PLANE_MM = HandShape.default().palm_outline_mm
POINTS_MM = np.column_stack([PLANE_MM, np.zeros(len(PLANE_MM))])


@pytest.mark.parametrize(("noise_px", "tilt_max_deg"), [(1.0, 60), (1.0, 10), (0.3, 60)])
def test_median_error_is_no_larger_than_ippes(noise_px, tilt_max_deg):
    scores = {score.solver: score for score in compare_palm(noise_px, tilt_max_deg)}
    ours, ippe = scores["ours"], scores["IPPE"]
    print(f"\n{noise_px} px, tilt up to {tilt_max_deg} deg; ratio of the medians, ours to IPPE: ")
    print(f"{ours.median_deg / ippe.median_deg:.2f}", *scores.values(), sep="\n  ")
    assert ours.median_deg <= 1.02 * ippe.median_deg
    assert ours.right_first >= ippe.right_first - 0.02
    assert ours.median_deg < scores["orthographic"].median_deg


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


def test_bench_prints_a_table(capsys):
    assert BenchPalm(noise_px=(1.0,), tilt_max_deg=(30.0,), poses=10)() == 0
    printed = capsys.readouterr().out
    assert printed.count("\n") >= 4
    assert "IPPE" in printed
    with pytest.raises(InputError, match="poses"):
        BenchPalm(poses=0)()
