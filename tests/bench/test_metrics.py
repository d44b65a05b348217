"""The metrics tell a good tracker from a broken one."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.metrics import (
    bends_deg,
    coverage,
    found_share,
    frames_to_find,
    mcp_angles_deg,
    palm_frames,
    score,
)
from handtrack.bench.tracks import Track, read_track, read_truth
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import KEYPOINT_NAMES

FRAMES = 60
CAMERA = Camera.assumed_for(640, 480)


def angles() -> np.ndarray:
    t = np.arange(FRAMES)[:, None] / 30
    rate = np.linspace(0.4, 1.3, 20)
    return np.radians(25 + 20 * np.sin(2 * np.pi * rate * t + np.arange(20)))


def track_of(theta: np.ndarray, std_deg: float = 5.0, shift_px: float = 0.0) -> Track:
    points = keypoints_mm(theta, HandShape.default())
    turn = rotation.about_y(0.5 * np.sin(np.arange(len(theta)) / 9)) @ np.diag([1.0, -1, -1])
    points = np.einsum("fij,fkj->fki", turn, points)
    points += np.array([0.0, 80.0, 450.0])
    px = CAMERA.project(points) + shift_px
    std = np.full_like(theta, np.radians(std_deg))
    return Track(px, points, theta, std, np.ones(len(theta), bool))


TRUTH = track_of(angles())


def test_the_truth_scores_perfectly() -> None:
    got = score(TRUTH, TRUTH)
    errors = [n for n in got if n.endswith(("_deg", "_px")) and "jitter" not in n]
    assert len(errors) >= 14
    assert {n: got[n] for n in errors} == pytest.approx(dict.fromkeys(errors, 0.0), abs=1e-5)
    assert got["tracked_share"] == got["coverage_90"] == 1.0
    assert got["lag_frames"] == pytest.approx(0.0, abs=0.05)
    assert got["jitter_deg"] == got["jitter_truth_deg"] > 0


def test_a_hand_is_found_where_its_keypoints_are_near() -> None:
    palm_px = np.linalg.norm(TRUTH.keypoints_px[:, 9] - TRUTH.keypoints_px[:, 0], axis=-1)
    off = 0.3 * np.median(palm_px) / np.sqrt(2)  # right and down
    assert found_share(track_of(angles(), shift_px=0.95 * off), TRUTH) == 1.0
    assert found_share(track_of(angles(), shift_px=1.05 * off), TRUTH) == 0.0
    px = TRUTH.keypoints_px.copy()
    px[:15] = np.nan
    assert found_share(replace(TRUTH, keypoints_px=px), TRUTH) == pytest.approx(0.75)


def test_bend_is_the_flexion_that_was_put_in() -> None:
    theta = np.zeros((1, 20))
    theta[0, [10, 11]] = np.radians([40.0, 25.0])
    bends = bends_deg(keypoints_mm(theta, HandShape.default()))
    assert bends[0, 2] == pytest.approx([0.0, 40.0, 25.0], abs=1e-6)


def test_bends_do_not_see_pose_scale_or_mirror() -> None:
    rng = np.random.default_rng(0)
    points = keypoints_mm(angles()[:5], HandShape.default())
    R = rotation.exp(rng.normal(size=3))
    moved = 0.37 * points @ R.T + rng.normal(size=3)
    assert bends_deg(moved) == pytest.approx(bends_deg(points), abs=1e-6)
    assert bends_deg(points * (-1, 1, 1)) == pytest.approx(bends_deg(points), abs=1e-6)
    assert palm_frames(moved) == pytest.approx(R @ palm_frames(points), abs=1e-9)


def test_mcp_angles_of_the_middle_finger_are_its_own() -> None:
    theta = np.zeros((1, 20))
    theta[0, 8] = np.radians(35.0)
    before, _ = mcp_angles_deg(keypoints_mm(np.zeros((1, 20)), HandShape.default()))
    after, _ = mcp_angles_deg(keypoints_mm(theta, HandShape.default()))
    assert (after - before)[0, 1] == pytest.approx(35.0, abs=1e-6)


def test_shuffled_angles_are_caught() -> None:
    theta = angles().reshape(FRAMES, 5, 4)[:, [0, 2, 4, 1, 3]].reshape(FRAMES, 20)
    got = score(track_of(theta), TRUTH)
    assert got["bend_deg"] > 5
    assert got["bend_free_deg"] > 5  # no constant offset explains it
    assert got["coverage_90"] < 0.5


def test_a_shift_of_one_frame_is_caught() -> None:
    late = track_of(angles()[[0, *range(FRAMES - 1)]])
    poses = np.concatenate([[0], np.arange(FRAMES - 1)])
    whole = Track(
        TRUTH.keypoints_px[poses], TRUTH.keypoints_mm[poses], late.theta, late.theta_std, late.shown
    )
    got = score(whole, TRUTH)
    assert got["lag_frames"] == pytest.approx(1.0, abs=0.2)
    assert got["bend_deg"] > 0.5


def test_a_constant_offset_is_taken_off_and_nothing_else() -> None:
    theta = angles()
    theta[:, 6] += np.radians(10.0)  # index PIP
    got = score(track_of(theta), TRUTH)
    assert got["index_pip_deg"] == pytest.approx(10.0, abs=1e-6)
    assert got["bend_free_deg"] == pytest.approx(0.0, abs=1e-6)
    noisy = angles()
    noisy[::2, 6] += np.radians(10.0)
    assert score(track_of(noisy), TRUTH)["bend_free_deg"] > 0.3


def test_noise_is_jitter() -> None:
    rng = np.random.default_rng(3)
    shaky = score(track_of(angles() + rng.normal(0, np.radians(2.0), (FRAMES, 20))), TRUTH)
    assert shaky["jitter_deg"] > shaky["jitter_truth_deg"] + 2


def test_coverage_of_a_normal_error_is_what_it_says() -> None:
    rng = np.random.default_rng(4)
    theta = angles()
    wrong = theta + rng.normal(0, np.radians(5.0), theta.shape)
    assert coverage(track_of(wrong, std_deg=5.0), TRUTH) == pytest.approx(0.9, abs=0.03)
    assert coverage(track_of(wrong, std_deg=1.0), TRUTH) < 0.35


@pytest.mark.parametrize(("about", "seen_deg"), [("z", 8.0), ("x", 0.0), ("y", 0.0)])
def test_a_turn_in_the_image_is_one_about_the_camera_s_axis(about, seen_deg) -> None:
    turn = {"x": rotation.about_x, "y": rotation.about_y, "z": rotation.about_z}[about]
    turned = TRUTH.keypoints_mm @ turn(np.radians(8.0)).T
    got = score(replace(TRUTH, keypoints_mm=turned), TRUTH)
    assert got["palm_deg"] == pytest.approx(8.0, abs=1e-6)
    assert got["palm_in_image_deg"] == pytest.approx(seen_deg, abs=1e-6)


def test_pixels_and_paper_x() -> None:
    got = score(track_of(angles(), shift_px=3.0), TRUTH)
    assert got["keypoints_px"] == pytest.approx(3.0 * np.sqrt(2))
    assert got["x_px"] == pytest.approx(3.0)


def test_waiting_for_the_hand_is_counted() -> None:
    shown = np.array([1, 1, 0, 0, 1, 1, 1, 1], bool)
    tracked = np.array([1, 1, 0, 0, 0, 0, 1, 1], bool)
    assert frames_to_find(tracked, shown) == 2
    assert frames_to_find(np.zeros(8, bool), shown) == 8


def test_lost_frames_count_in_the_share_only() -> None:
    px, mm = TRUTH.keypoints_px.copy(), TRUTH.keypoints_mm.copy()
    px[:15], mm[:15] = np.nan, np.nan
    theta = TRUTH.theta.copy()
    theta[:15] = np.nan
    got = score(Track(px, mm, theta, TRUTH.theta_std, np.arange(FRAMES) >= 15), TRUTH)
    assert got["tracked_share"] == 0.75
    assert got["bend_deg"] == pytest.approx(0.0, abs=1e-9)


def test_a_foreign_table_is_read(tmp_path) -> None:
    columns = [f"{n}_{a}_px" for n in KEYPOINT_NAMES for a in "xy"]
    lines = [",".join(["frame", *columns])]
    for k in (0, 2, 3):
        lines.append(",".join(map(str, [k, *TRUTH.keypoints_px[k].ravel()])))
    (tmp_path / "other.csv").write_text("\n".join(lines))
    track = read_track(tmp_path / "other.csv", FRAMES)
    assert track.shown.nonzero()[0].tolist() == [0, 2, 3]
    got = score(track, TRUTH)
    assert got["keypoints_px"] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(got["bend_deg"])


@pytest.mark.parametrize("text", ["", "frame,wrist_x_px\n0,1\n", "a,b\n1,2\n"])
def test_other_tables_are_refused(tmp_path, text) -> None:
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InputError, match=r"x\.csv"):
        read_track(tmp_path / "x.csv", 10)


def test_a_missing_truth_is_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match="not the truth"):
        read_truth(tmp_path / "truth.npz")
