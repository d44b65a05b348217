"""From the shell: attach, rank, hand over; every bad input in one line, nothing half-written."""

import json

import numpy as np
import pytest

from handtrack import rotation
from handtrack.cli import main
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import ANGLE_NAMES
from handtrack.mocap.alphabet import perform
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.database import read_clip
from handtrack.mocap.mapping import read_mapping
from handtrack.mocap.marker_io import read_markers, write_markers
from handtrack.mocap.marker_sets import marker_set
from handtrack.mocap.markers import Markers
from handtrack.output.bvh import write_hand_bvh
from handtrack.trajectory import Trajectory

SIX = "thumb_tip,index_tip,middle_tip,ring_tip,little_tip,index_dip"
SAME_DEG = 1e-3


def write_motion(path, what, seed, rate=60.0, side="right"):
    rng = np.random.default_rng(seed)
    theta = perform(what, rng, rate)
    turn = np.cumsum(rng.normal(0, 0.02, (len(theta), 3)), axis=0)
    R, t = rotation.exp(turn), 10 * turn + 100
    write_hand_bvh(path, theta, R, t, HandShape.default(), side, 1 / rate)
    return theta


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """A folder with a data base, a query motion, and the query's markers."""
    folder = tmp_path_factory.mktemp("stage")
    write_motion(folder / "base.bvh", "counting", 1)
    theta = write_motion(folder / "take.bvh", ["1", "3", "5"], 2)
    assert main(["markers", "attach", str(folder / "take.bvh"), "-o", str(folder / "q.c3d")]) == 0
    return folder, theta


def handover(stage, query, *more, out="out"):
    folder = stage[0]
    return main(
        ["handover", str(query), "--database", str(folder / "base.bvh"), "--out", str(folder / out)]
        + [str(word) for word in more]
    )


def read_angles(path):
    lines = [line.split(",") for line in path.read_text().splitlines()]
    columns = [lines[0].index(f"{name}_deg") for name in ANGLE_NAMES]
    return lines[0], np.array([[float(row[c] or "nan") for c in columns] for row in lines[1:]])


def test_attach_rank_handover_and_back(stage, capsys):
    folder, theta = stage
    assert main(["markers", "rank", str(folder / "base.bvh"), "-o", str(folder / "r.png")]) == 0
    said = capsys.readouterr().out
    assert said.count("*") == 6
    assert "top 6: " in said
    assert (folder / "r.png").read_bytes().startswith(b"\x89PNG")
    assert handover(stage, folder / "q.c3d", "--markers", SIX) == 0
    out = folder / "out"
    assert sorted(p.name for p in out.iterdir()) == [
        "angles.csv",
        "keypoints.csv",
        "motion.bvh",
        "report.html",
        "run.json",
    ]
    _, table = read_angles(out / "angles.csv")
    motion = read_bvh(out / "motion.bvh")
    back = np.degrees(read_mapping("handtrack").theta(motion)[0])
    assert abs(back - table).max() < SAME_DEG
    assert abs(table - np.degrees(theta)).mean() < 9
    # the hand stands where the performer's stood
    true_wrist = read_bvh(folder / "take.bvh").world().joints[:, 0]
    np.testing.assert_allclose(motion.world().joints[:, 0], true_wrist, atol=0.01)
    record = json.loads((out / "run.json").read_text())
    assert record["query"]["markers"] == SIX.split(",")
    assert record["counts"]["tracked"] == len(theta)
    assert "<img" in (out / "report.html").read_text()


def test_a_hand_over_is_loaded_as_a_trajectory_and_not_exported(stage, capsys):
    folder = stage[0]
    assert handover(stage, folder / "q.c3d", out="loaded") == 0
    hand = Trajectory.load(folder / "loaded")
    true = read_bvh(folder / "take.bvh").world().joints[:, 0]
    np.testing.assert_allclose(hand.keypoints_mm[:, 0], true, atol=0.01)
    np.testing.assert_allclose(hand.palm_mm, true, atol=0.01)
    assert np.isnan(hand.keypoints_px).all()
    capsys.readouterr()
    assert main(["export", str(folder / "loaded"), "--to", "trc"]) == 2
    assert "hand-over" in capsys.readouterr().err


def test_same_input_same_bytes(stage):
    folder = stage[0]
    for out in ("one", "two"):
        assert handover(stage, folder / "q.c3d", "--quiet", out=out) == 0
    for name in ("angles.csv", "keypoints.csv", "motion.bvh"):
        assert (folder / "one" / name).read_bytes() == (folder / "two" / name).read_bytes()


def test_a_left_hand(stage, tmp_path):
    theta = write_motion(tmp_path / "l.bvh", "counting", 3, side="left")
    assert main(["markers", "attach", str(tmp_path / "l.bvh"), "-o", str(tmp_path / "l.trc")]) == 0
    words = ["handover", str(tmp_path / "l.trc"), "--database", str(tmp_path / "l.bvh")]
    assert main([*words, "--out", str(tmp_path / "o"), "--taps", "1"]) == 0
    header, table = read_angles(tmp_path / "o" / "angles.csv")
    assert abs(table - np.degrees(theta)).max() < 0.01  # the data base holds the query
    row = (tmp_path / "o" / "angles.csv").read_text().splitlines()[1].split(",")
    assert row[header.index("side")] == "left"
    back = read_bvh(tmp_path / "o" / "motion.bvh").world()
    true = read_bvh(tmp_path / "l.bvh").world()
    np.testing.assert_allclose(back.ends, true.ends, atol=0.5)


def test_dropouts_are_survived_reported_and_widen_the_uncertainty(stage, tmp_path):
    folder = stage[0]
    markers = read_markers(folder / "q.c3d")
    positions = markers.positions_mm.copy()
    index = [markers.labels.index(m) for m in ("index_tip", "index_dip", "index_pip")]
    positions[60:70, index] = np.nan
    positions[30:33, [markers.labels.index("root_wrist")]] = np.nan
    hand = [k for k, m in enumerate(markers.labels) if not m.startswith("root")]
    positions[np.ix_(range(40, 42), hand)] = np.nan
    write_markers(Markers(markers.labels, positions, markers.rate_hz), tmp_path / "q.csv")
    assert handover(stage, tmp_path / "q.csv", out="holes") == 0
    lines = (folder / "holes" / "angles.csv").read_text().splitlines()
    header = lines[0].split(",")
    rows = [line.split(",") for line in lines[1:]]
    status = [row[header.index("status")] for row in rows]
    assert status[60] == status[31] == "predicted"
    assert status[40] == "lost"
    assert rows[40][header.index("index_pip_flexion_deg")] == ""
    assert handover(stage, folder / "q.c3d", out="whole") == 0
    whole = [line.split(",") for line in (folder / "whole/angles.csv").read_text().splitlines()]
    column = header.index("index_pip_flexion_std_deg")
    std, before = ([float(r[column]) for r in part[60:70]] for part in (rows, whole[1:]))
    assert np.mean(std) > 1.2 * np.mean(before)
    spans = json.loads((folder / "holes" / "run.json").read_text())["query"]["gaps"]
    assert {"label": "index_tip", "first": 60, "last": 69} in spans
    assert {"label": "root", "first": 30, "last": 32} in spans


@pytest.mark.parametrize("suffix", [".c3d", ".trc", ".tsv", ".csv"])
def test_attach_writes_every_format(stage, tmp_path, suffix):
    out = tmp_path / f"m{suffix}"
    words = ["markers", "attach", str(stage[0] / "take.bvh"), "-o", str(out)]
    assert main([*words, "--noise-mm", "0.2", "--dropout", "0.05", "--seed", "3"]) == 0
    assert len(read_markers(out).labels) == 16


def refused(capsys, folder, code, *parts):
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    assert "Traceback" not in said
    for part in parts:
        assert part in said, said
    assert not folder.exists()
    assert code != 0


def test_a_query_whose_markers_are_strangers(stage, capsys):
    folder = stage[0]
    code = handover(stage, folder / "q.c3d", "--markers", "thumb_tip,nose", out="no")
    refused(capsys, folder / "no", code, "nose", "the query has root_wrist", "the data base has")


def test_a_query_without_the_root(stage, tmp_path, capsys):
    markers = read_markers(stage[0] / "q.c3d")
    rest = [m for m in markers.labels if m != "root_index"]
    write_markers(markers.select(rest), tmp_path / "q.c3d")
    code = handover(stage, tmp_path / "q.c3d", out="no")
    refused(capsys, stage[0] / "no", code, "root_index", "three or more")


def test_two_root_markers_asked_for(stage, capsys):
    root = ["--root", "root_wrist", "root_index"]
    code = handover(stage, stage[0] / "q.c3d", *root, out="no")
    refused(capsys, stage[0] / "no", code, "2 root markers")


def test_the_other_hand(stage, tmp_path, capsys):
    write_motion(tmp_path / "left.bvh", ["1", "3"], 3, side="left")
    words = ["handover", str(stage[0] / "q.c3d"), "--database", str(tmp_path / "left.bvh")]
    code = main([*words, "--out", str(tmp_path / "no")])
    refused(capsys, tmp_path / "no", code, "mirror image", "left hand")


def test_greedy_ranking_and_closing_from_the_shell(stage, tmp_path, capsys):
    folder, theta = stage
    base = str(folder / "base.bvh")
    words = ["markers", "rank", base, "--method", "greedy", "--top", "2", "--power", "3"]
    assert main([*words, "--close-mm", "0.2", "-o", str(tmp_path / "r.png")]) == 0
    said = capsys.readouterr().out
    assert said.count("*") == 2
    off = {}
    for close_mm in (0, 0.2):
        more = ["--markers", SIX, "--power", "3", "--close-mm", close_mm]
        assert handover(stage, folder / "q.c3d", *more, out=f"close{close_mm}") == 0
        found = read_angles(folder / f"close{close_mm}" / "angles.csv")[1]
        off[close_mm] = np.abs(found - np.degrees(theta)).mean()
    assert off[0.2] < 0.8 * off[0]


def test_borrowing_and_a_second_round_from_the_shell(stage, capsys):
    folder, theta = stage
    more = ["--markers", SIX, "--power", "3", "--close-mm", "0.2", "--borrow", "50"]
    assert handover(stage, folder / "q.c3d", *more, "--rounds", "2", out="two") == 0
    found = read_angles(folder / "two" / "angles.csv")[1]
    assert np.abs(found - np.degrees(theta)).mean() < 3
    said = json.loads((folder / "two" / "run.json").read_text())["settings"]
    assert (said["borrow"], said["rounds"]) == (50, 2)
    code = handover(stage, folder / "q.c3d", "--rounds", "2", out="no")
    refused(capsys, folder / "no", code, "2 rounds", "--close-mm")


def test_metres_taken_for_mm(stage, tmp_path, capsys):
    m = read_markers(stage[0] / "q.c3d")
    write_markers(Markers(m.labels, m.positions_mm / 1000, m.rate_hz), tmp_path / "q.c3d")
    code = handover(stage, tmp_path / "q.c3d", out="no")
    refused(capsys, stage[0] / "no", code, "0.001 times", "metres")


def test_all_markers_missing(stage, tmp_path, capsys):
    m = read_markers(stage[0] / "q.c3d")
    positions = m.positions_mm.copy()
    positions[:, 3:] = np.nan
    write_markers(Markers(m.labels, positions, m.rate_hz), tmp_path / "q.c3d")
    code = handover(stage, tmp_path / "q.c3d", out="no")
    refused(capsys, stage[0] / "no", code, "q.c3d", "no marker is seen")


def test_another_rate_is_resampled_on_request_only(stage, tmp_path, capsys):
    m = read_markers(stage[0] / "q.c3d")
    write_markers(Markers(m.labels, m.positions_mm[::2], 30.0), tmp_path / "q.c3d")
    code = handover(stage, tmp_path / "q.c3d", out="no")
    refused(capsys, stage[0] / "no", code, "30 Hz", "60 Hz", "--resample")
    assert handover(stage, tmp_path / "q.c3d", "--resample", out="yes") == 0


def test_broken_files(stage, tmp_path, capsys):
    folder = stage[0]
    (tmp_path / "empty.c3d").write_bytes(b"")
    refused(capsys, folder / "no", handover(stage, tmp_path / "empty.c3d", out="no"), "is empty")
    (tmp_path / "cut.c3d").write_bytes((folder / "q.c3d").read_bytes()[:-5000])
    refused(capsys, folder / "no", handover(stage, tmp_path / "cut.c3d", out="no"), "cut short")
    lines = (folder / "base.bvh").read_text().splitlines()
    lines[-3] = lines[-3].rpartition(" ")[0]
    (tmp_path / "b.bvh").write_text("\n".join(lines))
    words = ["handover", str(folder / "q.c3d"), "--database", str(tmp_path / "b.bvh")]
    code = main([*words, "--out", str(tmp_path / "no")])
    refused(capsys, tmp_path / "no", code, "b.bvh", "channels")
    code = main(["markers", "attach", str(tmp_path / "b.bvh"), "-o", str(tmp_path / "no.c3d")])
    refused(capsys, tmp_path / "no.c3d", code, "channels")


def test_a_mapping_that_names_a_joint_that_is_not_there(stage, tmp_path, capsys):
    out = tmp_path / "m.c3d"
    words = ["markers", "attach", str(stage[0] / "take.bvh"), "--mapping", "manipnet"]
    code = main([*words, "-o", str(out)])
    refused(capsys, out, code, "INDEX_PIP_FE", "take.bvh")


def test_recorded_markers_beside_the_motion_are_used(stage, tmp_path, capsys):
    folder = stage[0]
    for name in ("take.bvh", "take.c3d"):
        source = folder / ("q.c3d" if name.endswith("c3d") else name)
        (tmp_path / name).write_bytes(source.read_bytes())
    clip = read_clip(tmp_path / "take.bvh", marker_set("tips5"))
    assert len(clip.markers.labels) == 16
    m = read_markers(folder / "q.c3d")
    write_markers(Markers(m.labels, m.positions_mm[:-4], m.rate_hz), tmp_path / "take.c3d")
    words = ["handover", str(folder / "q.c3d"), "--database", str(tmp_path / "take.bvh")]
    code = main([*words, "--out", str(tmp_path / "no")])
    refused(capsys, tmp_path / "no", code, "frames of markers beside")


def test_ranking_of_a_marker_file_alone(stage, tmp_path, capsys):
    words = ["markers", "rank", str(stage[0] / "q.c3d"), "-o", str(tmp_path / "r.png")]
    assert main([*words, "--top", "3", "--method", "unweighted"]) == 0
    assert capsys.readouterr().out.count("*") == 3
    code = main([*words[:-1], str(tmp_path / "no.png"), "--method", "greedy"])
    refused(capsys, tmp_path / "no.png", code, "marker files hold no angles")
