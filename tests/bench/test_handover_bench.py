"""The benchmark of the marker method: what it must find, and a ratchet on what it reaches."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.channels import mean_knuckles, rotation_channels
from handtrack.bench.handover_splits import over_splits
from handtrack.bench.handover_study import (
    CLOSED,
    MANUAL6,
    PAPER,
    by_components,
    cluster_pose_six,
    errors,
    leave_one_out_mm,
    score,
    study,
    with_and_without_pca,
)
from handtrack.cli import main
from handtrack.mocap.database import shipped_clip
from handtrack.mocap.marker_io import read_markers
from handtrack.mocap.ranking import rank

BASELINE = Path(__file__).with_name("handover_baseline.json")
#: A change of the error that is no change, in degrees.
FLOOR_DEG = 0.1


@pytest.fixture(scope="module")
def alphabet():
    """The alphabet against a word and the counting, at 30 Hz."""
    tests = [shipped_clip("girl", 1), shipped_clip("counting", 2)]
    return study("alphabet", [shipped_clip("alphabet", 0, runs=2)], tests, stride=4)


def test_components_are_another_basis_and_no_more(alphabet):
    ranking = rank(alphabet.base.labels, alphabet.base.X_mm)
    found = with_and_without_pca(alphabet, ranking.top(6))
    straight = found["straight to angles"]
    np.testing.assert_allclose(found["through all components"], straight, atol=1e-6)
    truncated = next(v for k, v in found.items() if k.endswith("(95 %)"))
    wrapped = found["straight to Euler channels that wrap"]
    assert np.mean(straight) < np.mean(truncated) < np.mean(wrapped)


def test_more_components_and_more_markers_are_better(alphabet):
    ranking = rank(alphabet.base.labels, alphabet.base.X_mm)
    curve = {k: np.mean(v) for k, v in by_components(alphabet, ranking.top(6)).items()}
    assert curve[1] > curve[4] > curve[12] > curve[20] - 1e-9
    np.testing.assert_allclose(curve[20], np.mean(errors(alphabet, ranking.top(6))), atol=1e-6)
    three, six, every = (np.mean(errors(alphabet, ranking.top(n))) for n in (3, 6, 13))
    assert three > six > every


def test_smooth_but_not_late_and_honest(alphabet):
    ranking = rank(alphabet.base.labels, alphabet.base.X_mm)
    for clip in alphabet.tests:
        got = score(alphabet, clip, ranking.top(6))
        assert got.lag_frames == 0
        assert 0.8 < got.inside_90 < 0.99


def test_channels_are_rotations_about_the_mean(alphabet):
    theta = alphabet.base.theta[::20]
    about = mean_knuckles(theta)
    seen = rotation_channels(theta, about)
    assert seen.shape == (len(theta), 24)
    np.testing.assert_array_equal(seen[:, :4], theta[:, :4])
    np.testing.assert_array_equal(seen[:, [7, 8]], theta[:, 6:8])
    # a knuckle's vector is as long as its angle from the mean, and is zero in the mean
    R = rotation.about_z(-theta[:, 5]) @ rotation.about_x(theta[:, 4])
    far = rotation.angle_between(R, about[0])
    np.testing.assert_allclose(np.linalg.norm(seen[:, 4:7], axis=1), far, atol=1e-9)
    assert np.abs(seen[:, 4:7].mean(axis=0)).max() < 0.02


def test_the_error_by_channels_is_smaller_where_knuckles_err_about_one_axis(alphabet):
    clip = alphabet.tests[0]
    got = score(alphabet, clip, rank(alphabet.base.labels, alphabet.base.X_mm).top(6))
    assert 0.7 * got.error_deg < got.channels_deg < got.error_deg


def test_cluster_pose_set_is_one_of_the_data_base(alphabet):
    six = cluster_pose_six(alphabet.base, np.random.default_rng(0))
    assert len(set(six)) == 6
    assert set(six) <= set(alphabet.base.labels)


def test_a_marker_is_predicted_from_the_others_on_a_real_recording(shared):
    markers = read_markers(shared / "data/dfki/recording.tsv")
    assert markers.unit == "mm"
    seen = markers.select(["thumb_tip"]).seen.mean()
    assert 1 - seen == pytest.approx(0.082, abs=0.002)
    small = replace(markers, positions_mm=markers.positions_mm[::10])
    root = ("hand_top", "hand_left", "hand_right")
    found = leave_one_out_mm(small, root, ("index_middle", "index_tip", "middle_tip"))
    assert all(0 < error < 60 for error in found.values())


def test_every_pair_of_clips_is_held_out_once():
    clips = {name: shipped_clip(name, 3) for name in ("girl", "walk", "counting")}
    said = []

    def sets(s):
        return [("all 13", s.base.labels, PAPER), ("manual 6", MANUAL6, PAPER)]

    rows = over_splits(clips, 8, said.append, sets)
    assert said == ["counting, girl", "counting, walk", "girl, walk"]
    for row in rows.values():
        assert row.best_deg <= row.median_deg <= row.worst_deg
        assert row.mean_deg == pytest.approx(np.mean(list(row.by_clip_deg.values())), abs=0.002)
    assert rows["all 13"].mean_deg < rows["manual 6"].mean_deg


def test_the_hand_closed_on_its_markers_is_honest_too(alphabet):
    six = rank(alphabet.base.labels, alphabet.base.X_mm).top(6)
    for clip in alphabet.tests:
        plain, closed = score(alphabet, clip, six), score(alphabet, clip, six, CLOSED)
        assert closed.error_deg < 0.6 * plain.error_deg
        assert closed.lag_frames == 0
        assert 0.8 < closed.inside_90 < 0.99


def test_the_command_writes_a_page_and_a_record(tmp_path, capsys):
    out = tmp_path / "bench"
    assert main(["bench", "handover", "--only", "nothing", "-o", str(out)]) == 0
    assert json.loads((out / "handover.json").read_text())["studies"] == {}
    assert main(["bench", "handover", "--recordings", str(tmp_path / "none"), "-o", str(out)]) == 2
    assert "no such folder" in capsys.readouterr().err


def test_no_worse_than_the_baseline(alphabet):
    ranking = rank(alphabet.base.labels, alphabet.base.X_mm)
    sets = {"all 13": ranking.order, "ranked 6": ranking.top(6), "ranked 3": ranking.top(3)}
    sets["manual 6"] = MANUAL6
    now = {name: float(np.mean(errors(alphabet, chosen))) for name, chosen in sets.items()}
    damped = replace(PAPER, regression=replace(PAPER.regression, ridge_mm=0.5))
    now["ranked 6, damped"] = float(np.mean(errors(alphabet, ranking.top(6), damped)))
    for name in ("ranked 6", "ranked 3", "manual 6"):
        now[f"{name}, closed"] = float(np.mean(errors(alphabet, sets[name], CLOSED)))
    baseline = json.loads(BASELINE.read_text())
    assert set(now) == set(baseline)
    worse = {
        name: (now[name], baseline[name]) for name in now if now[name] > baseline[name] + FLOOR_DEG
    }
    assert worse == {}
