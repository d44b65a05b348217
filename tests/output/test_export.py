"""Exports: each read back by a reader that is not ours, and nothing when something is wrong."""

import csv
import json
import re
import resource
import signal
import sys

import numpy as np
import pytest

from handtrack import Trajectory
from handtrack.cli import main
from handtrack.errors import InputError, NothingUsableError, OutputError
from handtrack.hand.skeleton import KEYPOINT_NAMES, TIPS
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.mapping import read_mapping
from handtrack.mocap.marker_io import read_markers
from handtrack.output import points
from handtrack.output.export import WRITERS, Export, export_run
from handtrack.output.parquet import unit_of
from handtrack.tables import read_tables

TIP_TOLERANCE_MM = 0.1
TABLE_TOLERANCE_MM = 1e-4
SIDES = pytest.mark.parametrize("side", ["right", "left"])


def exported(run, name, **options):
    export_run(Export(run, name, **options))
    return (options.get("out") or run / "export") / WRITERS[name][0]


def upright(points_mm):
    """Camera axes (y down, z forward) as y up, z to the viewer, written out."""
    return np.stack([points_mm[..., 0], -points_mm[..., 1], -points_mm[..., 2]], axis=-1)


@SIDES
def test_fingertips_of_the_bvh_by_another_forward_kinematics(side, make_run):
    bvhio = pytest.importorskip("bvhio")
    run = make_run(side)
    path = exported(run, "bvh")
    hand = read_tables(run)
    wanted = upright(hand.keypoints_mm)
    ends = {joint.Name: joint.EndSite for joint, _, _ in bvhio.readAsBvh(str(path)).Root.layout()}
    root = bvhio.readAsHierarchy(str(path))
    joints = {joint.Name: joint for joint, _, _ in root.layout()}
    for k in np.flatnonzero(np.isfinite(wanted).all(axis=(1, 2))):
        root.loadPose(int(k))
        for p, name in enumerate(KEYPOINT_NAMES):
            last = joints[KEYPOINT_NAMES[p - 1]] if p in TIPS else joints[name]
            found = last.pointToWorld(ends[last.Name]) if p in TIPS else last.PositionWorld
            assert np.abs(np.array(found) - wanted[k, p]).max() < TIP_TOLERANCE_MM, (k, name)


@SIDES
def test_bvh_reads_back_to_the_angles_at_the_rate_of_the_clip(side, make_run):
    run = make_run(side)
    motion = read_bvh(exported(run, "bvh"))
    hand = read_tables(run)
    known = np.isfinite(hand.theta).all(axis=1)
    assert motion.n_frames == len(hand) == 12
    assert motion.frame_time_s == pytest.approx(1 / 30, abs=1e-9)
    theta = read_mapping("handtrack").theta(motion)[0]
    np.testing.assert_allclose(theta[known], hand.theta[known], atol=1e-6)
    np.testing.assert_array_equal(theta[5], theta[4])  # not known: the last known stays


@pytest.mark.parametrize(("unit", "per_mm"), [("cm", 0.1), ("m", 0.001)])
def test_bvh_in_other_units(unit, per_mm, make_run, tmp_path):
    run = make_run()
    one = read_bvh(exported(run, "bvh")).world()
    other = read_bvh(exported(run, "bvh", unit=unit, out=tmp_path / "other")).world()
    np.testing.assert_allclose(other.ends, one.ends * per_mm, atol=1e-9)
    np.testing.assert_allclose(other.joints, one.joints * per_mm, atol=1e-9)
    np.testing.assert_allclose(other.R, one.R, atol=1e-9)


def test_trc_as_opensim_wants_it(make_run):
    run = make_run()
    text = exported(run, "trc").read_text()
    lines = text.split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    head = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    assert (float(head["DataRate"]), head["NumFrames"], head["NumMarkers"]) == (30.0, "12", "21")
    assert head["Units"] == "mm"
    names = lines[3].split("\t")
    assert names[:2] == ["Frame#", "Time"]
    assert tuple(names[2::3]) == KEYPOINT_NAMES
    assert lines[4].split("\t")[2:5] == ["X1", "Y1", "Z1"]
    assert lines[5] == ""
    rows = [line.split("\t") for line in lines[6:] if line]
    assert len(rows) == 12
    # a row that ends in an empty cell ends in a tab of its own: OpenSim wants it
    assert {len(row) for k, row in enumerate(rows) if k not in (0, 5)} == {2 + 3 * 21}
    assert [len(rows[k]) for k in (0, 5)] == [2 + 3 * 21 + 1] * 2
    rows = [row[: 2 + 3 * 21] for row in rows]
    assert [row[0] for row in rows] == [str(k + 1) for k in range(12)]
    found = np.array([[float(w or "nan") for w in row[2:]] for row in rows]).reshape(12, 21, 3)
    wanted = upright(read_tables(run).keypoints_mm)
    np.testing.assert_allclose(found, wanted, atol=TABLE_TOLERANCE_MM)
    assert set(rows[5][2:]) == {""}
    times = [float(row[1]) for row in rows]
    np.testing.assert_allclose(times, np.arange(12) / 30, atol=1e-6)


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_by_another_reader(make_run):
    c3d = pytest.importorskip("c3d")
    run = make_run("left")
    path = exported(run, "c3d")
    wanted = upright(read_tables(run).keypoints_mm)
    with open(path, "rb") as file:
        reader = c3d.Reader(file)
        assert reader.point_rate == 30.0
        assert tuple(label.strip() for label in reader.point_labels) == KEYPOINT_NAMES
        frames = [points.copy() for _, points, _ in reader.read_frames()]
    assert len(frames) == 12
    for found, row in zip(frames, wanted, strict=True):
        if np.isnan(row).any():
            assert (found[:, 3] == -1).all()
        else:
            assert (found[:, 3] >= 0).all()
            np.testing.assert_allclose(found[:, :3], row, atol=TABLE_TOLERANCE_MM)
    back = read_markers(path)
    np.testing.assert_allclose(back.positions_mm, wanted, atol=TABLE_TOLERANCE_MM)


def test_more_frames_than_c3d_can_count(make_run, monkeypatch):
    run = make_run()
    monkeypatch.setattr(points, "MOST_C3D_FRAMES", 11)
    with pytest.raises(InputError, match=r"12 frames are more than .* \(11\); --rate"):
        export_run(Export(run, "trc,c3d"))
    assert list((run / "export").iterdir()) == []


def test_json_of_the_keypoints(make_run):
    run = make_run("left")
    document = json.loads(exported(run, "json").read_text(encoding="utf-8"))
    hand = read_tables(run)
    assert (document["format"], document["version"]) == ("handtrack-keypoints", 1)
    assert tuple(document["keypoints"]) == KEYPOINT_NAMES
    assert [frame["frame"] for frame in document["frames"]] == list(range(12))
    for k, frame in enumerate(document["frames"]):
        assert frame["status"] == hand.status[k]
        assert frame["side"] == "left"
        assert frame["time_s"] == pytest.approx(hand.time_s[k])
        for unit in ("px", "mm"):
            values = getattr(hand, f"keypoints_{unit}")[k]
            if np.isnan(values).any():
                assert frame[unit] == [None] * 21
            else:
                np.testing.assert_allclose(frame[unit], values, atol=TABLE_TOLERANCE_MM)


def test_parquet_has_both_tables_and_their_units(make_run):
    pq = pytest.importorskip("pyarrow.parquet")
    run = make_run()
    table = pq.read_table(exported(run, "parquet"))
    note = json.loads(table.schema.metadata[b"handtrack"])
    assert note["run"]["clip"] == "clip.mp4"
    seen = set()
    for name in ("angles.csv", "keypoints.csv"):
        with open(run / name, newline="") as file:
            rows = list(csv.DictReader(file))
        for column in rows[0]:
            seen.add(column)
            found = table.column(column).to_pylist()
            wanted = [row[column] or None for row in rows]
            if column not in ("status", "side"):
                wanted = [None if w is None else pytest.approx(float(w)) for w in wanted]
            assert found == wanted, column
            unit = table.schema.field(column).metadata[b"unit"].decode()
            assert unit == unit_of(column)
            assert unit in ("", "1") or column.endswith(f"_{unit}")
    assert seen == set(table.column_names)


def test_missing_pyarrow_is_a_line_and_leaves_nothing(make_run, monkeypatch, capsys):
    run = make_run()
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["export", str(run), "--to", "json,parquet"]) == 2
    assert "pip install 'handtrack[parquet]'" in capsys.readouterr().err
    assert list((run / "export").iterdir()) == []


def test_command_writes_all_and_the_same_bytes_again(make_run, capsys):
    run = make_run()
    names = ",".join(WRITERS)
    folders = [run / "one", run / "two"]
    for folder in folders:
        assert main(["export", str(run), "--to", names, "--out", str(folder)]) == 0
    said = capsys.readouterr().out.split()
    assert said == [str(folder / WRITERS[name][0]) for folder in folders for name in WRITERS]
    for name in sorted(p.name for p in folders[0].iterdir()):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name
    assert len(list(folders[0].iterdir())) == len(WRITERS)


def test_uneven_times_are_said_and_resampled_on_request(make_run, capsys):
    times_s = np.cumsum([0, 0.03, 0.05, 0.04, 0.04, 0.1, 0.02, 0.04, 0.04, 0.04, 0.2, 0.04])
    run = make_run(times_s=times_s, lost={5})
    export_run(Export(run, "bvh,json"))
    assert re.search(
        r"stray up to 0\.\d+ s from an even 17\.188 Hz.*--rate", capsys.readouterr().out
    )
    assert read_bvh(run / "export" / "motion.bvh").n_frames == 12
    export_run(Export(run, "bvh,trc", rate=50))
    assert capsys.readouterr().out == ""
    motion, markers = (
        read_bvh(run / "export/motion.bvh"),
        read_markers(run / "export/keypoints.trc"),
    )
    assert motion.frame_time_s == pytest.approx(0.02)
    assert markers.rate_hz == 50
    hand = Trajectory.load(run)
    even = np.arange(markers.n_frames) / 50
    gap = (even > times_s[4] + 1e-6) & (even < times_s[6] - 1e-6)
    np.testing.assert_array_equal(~markers.seen.all(axis=1), gap)
    on_a_frame = 2 * 0.02 * 2  # 0.08 s is a frame of both
    k = int(np.argmin(abs(times_s - on_a_frame)))
    np.testing.assert_allclose(
        markers.positions_mm[4], upright(hand.keypoints_mm[k]), atol=TABLE_TOLERANCE_MM
    )


def test_one_frame(make_run):
    run = make_run(times_s=[0.5], lost=set())
    for name in WRITERS:
        assert exported(run, name).stat().st_size > 0


@pytest.mark.parametrize(
    ("to", "says"),
    [
        ("bvh,fbx", "unknown format 'fbx'; there are bvh, trc, c3d, json, parquet"),
        (" , ", "no format; there are bvh"),
    ],
)
def test_unknown_formats_name_the_list(to, says, make_run):
    run = make_run()
    with pytest.raises(InputError, match=re.escape(says)):
        export_run(Export(run, to))
    assert not (run / "export").exists()


def test_folders_that_cannot_be_used(make_run, tmp_path):
    with pytest.raises(InputError, match="is no folder; give the folder of a run"):
        export_run(Export(tmp_path / "none", "json"))
    with pytest.raises(InputError, match=r"no folder of a run \(it has no run\.json\)"):
        export_run(Export(tmp_path, "json"))
    run = make_run()
    (run / "hand.toml").unlink()
    with pytest.raises(InputError, match=r"hand\.toml: cannot be read"):
        export_run(Export(run, "json,bvh"))
    assert list((run / "export").iterdir()) == []
    with pytest.raises(InputError, match="--rate 0: wanted between"):
        export_run(Export(run, "json", rate=0))
    (run / "keypoints.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"keypoints\.csv: cannot be read"):
        export_run(Export(run, "json"))


def test_no_hand_in_any_frame(make_run):
    run = make_run(lost=set(range(12)))
    with pytest.raises(NothingUsableError, match="the hand is not known in any frame"):
        export_run(Export(run, "json"))


@pytest.mark.parametrize("name", list(WRITERS))
def test_full_disk_leaves_nothing(name, make_run):
    run = make_run()
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, limit[1]))
        with pytest.raises(OutputError, match=f"export/{re.escape(WRITERS[name][0])}: "):
            export_run(Export(run, name))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    assert list((run / "export").iterdir()) == []
