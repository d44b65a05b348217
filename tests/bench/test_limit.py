"""What perfect points tell: all with the true hand, less with one that is a little off."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack.bench.limit import BenchLimit, Gaussian, flattened, limit_of
from handtrack.bench.metrics import PAPER_ROWS
from handtrack.bench.tracks import read_truth
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Pose
from synth.cache import ClipCache
from synth.motion import FRONTAL


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    return tmp_path_factory.mktemp("clips")


@pytest.fixture(scope="module")
def clip(clips):
    return ClipCache(clips, frames=40)("paper", 0)


def test_error_falls_with_the_noise_and_vanishes_with_it(clip):
    coarse, fine, none = (limit_of(clip, "true", px, px, 0) for px in (2.0, 0.5, 0.005))
    for name in PAPER_ROWS:
        assert none[name] < 0.1
        assert none[name] < fine[name] < coarse[name]


def test_a_hand_that_is_a_little_off_is_what_limits(clip):
    true, flat, calibrated = (
        limit_of(clip, h, 0.3, 0.3, 0) for h in ("true", "flat", "calibrated")
    )
    for name in ("rotation_deg", "middle_mcp_deg"):
        assert max(true[name], flat[name]) < 0.7 * calibrated[name]


def test_a_flat_hand_is_measured_as_it_is(clip):
    shape, camera = HandShape.load(clip / "shape.toml"), Camera.load(clip / "camera.toml")
    points = Pose(FRONTAL, np.array([5.0, 60.0, 440.0])) @ keypoints_mm(np.zeros(20), shape)
    level = np.where(np.arange(3) == 2, 440.0, points)
    truth = read_truth(clip / "truth.npz")
    truth = replace(
        truth,
        keypoints_mm=np.broadcast_to(level, truth.keypoints_mm.shape),
        keypoints_px=np.broadcast_to(camera.project(level), truth.keypoints_px.shape),
    )
    found = flattened(shape, truth, camera)
    np.testing.assert_allclose(found.length_mm[1:], shape.length_mm[1:], rtol=0.02)
    np.testing.assert_allclose(found.base_mm, shape.base_mm, atol=1e-9)


def test_a_product_of_gaussians_lies_between_them():
    prior = Gaussian.of_hands()
    there = prior.mean + 0.5
    firm, loose = prior.and_near(there, 1e-4), prior.and_near(there, 1e4)
    np.testing.assert_allclose(firm.mean, there, atol=1e-6)
    np.testing.assert_allclose(loose.mean, prior.mean, atol=1e-6)
    np.testing.assert_allclose(loose.root.T @ loose.root, prior.root.T @ prior.root, rtol=1e-6)


def test_the_table_has_the_published_row_and_both_hands(clips, capsys):
    assert BenchLimit(seeds=1, frames=40, noise_px=(1.0,), clips=clips)() == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split("  ")[0] for row in rows[1:]] == ["(published)", "true", "flat", "calibrated"]
    assert "3.98" in rows[1]


@pytest.mark.parametrize("wrong", [{"noise_px": (0.0,)}, {"expected_px": -1.0}])
def test_a_noise_of_nothing_is_refused(wrong):
    with pytest.raises(InputError, match="more than 0"):
        BenchLimit(**wrong)()


def test_no_clips_are_refused():
    with pytest.raises(InputError, match="--seeds 0"):
        BenchLimit(seeds=0)()
