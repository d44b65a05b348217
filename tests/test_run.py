"""A run from clip to folder, with a tracker that is no tracker."""

import csv
import json
import os
import signal
import subprocess
import sys
import threading
from fractions import Fraction

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from handtrack import cli, rotation
from handtrack.camera import Camera
from handtrack.errors import InputError, OutputError
from handtrack.evidence.video import read_frames
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.output.provenance import read_provenance
from handtrack.output.table import read_tables
from handtrack.records import FrameResult, Pose, Status
from handtrack.run import RunSettings, run_clip

TABLES = ["angles.csv", "camera.toml", "hand.toml", "keypoints.csv"]
SHOWS = [*TABLES, "motion.bvh", "overlay.mp4", "report.html", "report_files", "run.json"]


class FakeTracker:
    """Says that an open left hand stands still in front of the camera; ``at`` does more."""

    def __init__(self, camera, status=lambda k: Status.TRACKED, at=lambda k: None):
        self.camera, self.status, self.at = camera, status, at
        self.shape = HandShape.default()
        self.timings_ms = {"fake": []}

    def step(self, frame):
        self.at(frame.index)
        self.timings_ms["fake"].append(float(frame.index))
        status = self.status(frame.index)
        if status is Status.LOST:
            return FrameResult.unknown(frame.index, frame.time_s)
        pose = Pose(rotation.about_x(np.pi), np.array([0.0, 90.0, 450.0]))
        points = pose @ (keypoints_mm(np.zeros(20), self.shape) * [-1, 1, 1])
        return FrameResult(
            index=frame.index,
            time_s=frame.time_s,
            status=status,
            side="left",
            confidence=0.9,
            ess=50.0,
            R=pose.R,
            t_mm=pose.t_mm,
            theta=np.zeros(20),
            theta_std=np.full(20, 0.1),
            keypoints_px=self.camera.project(points),
            keypoints_mm=points,
        )


def run(clip, out, status=lambda k: Status.TRACKED, at=lambda k: None, **settings):
    settings = RunSettings(clip, out, **settings)
    return run_clip(settings, lambda s, camera, shape: FakeTracker(camera, status, at))


def listing(folder):
    return sorted(p.name for p in folder.iterdir())


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_one_row_a_frame_with_the_containers_time_stamps(tmp_path, write_clip):
    pts_ms = [0, 33, 34, 500, 540, 2000]
    clip = write_clip(tmp_path / "Händ clip.mp4", n=6, pts_ms=pts_ms, audio=True)
    out = tmp_path / "out put"
    report = run(clip, out)
    assert listing(out) == SHOWS
    assert report.exit_code == 0
    assert report.last_line == (
        f"{clip}: container says 6, decoded 6, tracked 6 (predicted 0, lost 0, undecodable 0); "
        f"results in {out}"
    )
    for name in ("angles.csv", "keypoints.csv"):
        rows = rows_of(out / name)
        assert [int(row["frame"]) for row in rows] == list(range(6))
        assert [float(row["time_s"]) for row in rows] == pytest.approx(
            [t / 1000 for t in pts_ms], abs=1e-3
        )
    film = list(read_frames(out / "overlay.mp4"))
    assert [f.time_s for f in film] == pytest.approx([t / 1000 for t in pts_ms], abs=1e-3)


def test_what_is_written_is_what_was_tracked(tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=5)
    run(clip, tmp_path / "out", status=lambda k: Status.LOST if k == 2 else Status.TRACKED)
    hand = read_tables(tmp_path / "out")
    assert hand.status.tolist() == ["tracked", "tracked", "lost", "tracked", "tracked"]
    assert hand.side[0] == "left"
    np.testing.assert_allclose(hand.palm_mm[0], [0, 90, 450])
    np.testing.assert_allclose(hand.palm_R[0], rotation.about_x(np.pi), atol=1e-7)
    camera = Camera.load(tmp_path / "out" / "camera.toml")
    np.testing.assert_allclose(
        hand.keypoints_px[0], camera.project(hand.keypoints_mm[0]), atol=0.01
    )


def test_provenance(tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=4, size=(96, 64), aspect=Fraction(1, 2), rotate_deg=-90)
    run(clip, tmp_path / "out", seed=7, particles=33, method="paper", facing="back")
    record = read_provenance(tmp_path / "out")
    assert record["state"] == "complete"
    assert record["counts"] == {
        "container": 4,
        "decoded": 4,
        "undecodable": 0,
        "tracked": 4,
        "predicted": 0,
        "lost": 0,
    }
    assert record["clip"]["sample_aspect_ratio"] == "1/2"
    assert record["clip"]["rotation_applied_clockwise_deg"] == 90
    assert (record["clip"]["width_px"], record["clip"]["height_px"]) == (64, 48)
    assert record["camera_assumed"] is True
    assert record["hand"]["calibrated"] is False
    assert record["side"] == "left"
    assert record["settings"]["particles"] == 33
    assert record["settings"]["method"] == "paper"
    assert record["seed"] == 7
    assert record["timings_ms"]["fake"] == 1.5
    assert {"track", "wait for frame", "hand over"} <= set(record["timings_ms"])
    assert record["versions"]["numpy"] == np.__version__
    assert record["peak_memory_mb"] > 10


def test_same_input_same_bytes(tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=8)
    for name in ("one", "two"):
        run(clip, tmp_path / name)
    for name in ("angles.csv", "keypoints.csv", "hand.toml", "camera.toml", "overlay.mp4"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one == two, name


def test_linear_algebra_has_one_thread_while_tracking(tmp_path, write_clip):
    def threads():
        return {p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas"}

    seen = []
    clip = write_clip(tmp_path / "a.mp4", n=1)
    with threadpool_limits(2, user_api="blas"):
        run(clip, tmp_path / "out", at=lambda k: seen.append(threads()))
        assert threads() == {2}
    assert seen == [{1}]


def test_frames_before_the_start_are_lost_and_not_tracked(tmp_path, write_clip):
    seen = []
    clip = write_clip(tmp_path / "a.mp4", n=6)
    run(clip, tmp_path / "out", at=seen.append, start_frame=4, overlay=False)
    assert seen == [4, 5]
    assert read_tables(tmp_path / "out").status.tolist() == ["lost"] * 4 + ["tracked"] * 2


def test_no_hand_at_all_keeps_the_tables_and_says_so(tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=3)
    report = run(clip, tmp_path / "out", status=lambda k: Status.LOST)
    assert report.exit_code == 4
    assert "no hand was found; container says 3, decoded 3, tracked 0" in report.last_line
    assert listing(tmp_path / "out") == [name for name in SHOWS if name != "motion.bvh"]
    assert len(rows_of(tmp_path / "out" / "angles.csv")) == 3


def test_truncated_clip_keeps_what_came_before_the_break(tmp_path, write_clip):
    whole = write_clip(tmp_path / "whole.mp4", n=60).read_bytes()
    (tmp_path / "cut.mp4").write_bytes(whole[: len(whole) * 2 // 3])
    report = run(tmp_path / "cut.mp4", tmp_path / "out")
    assert report.exit_code == 5
    counts, rows = report.counts, rows_of(tmp_path / "out" / "angles.csv")
    assert counts.container == 60
    assert 0 < counts.decoded < 60
    assert len(rows) == counts.decoded + counts.undecodable
    assert sum(row["status"] == "undecodable" for row in rows) == counts.undecodable
    assert read_provenance(tmp_path / "out")["exit_code"] == 5


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_keeps_valid_partial_results(number, tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=40)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    report = run(
        clip, tmp_path / "out", at=lambda k: os.kill(os.getpid(), number) if k == 9 else None
    )
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
    assert report.exit_code == 130
    assert "interrupted" in report.last_line
    assert "decoded 10" in report.last_line
    assert listing(tmp_path / "out") == SHOWS
    assert len(rows_of(tmp_path / "out" / "angles.csv")) == 10
    assert len(list(read_frames(tmp_path / "out" / "overlay.mp4"))) == 10
    assert read_provenance(tmp_path / "out")["state"] == "interrupted"


def test_fault_in_the_tracker_keeps_what_was_done(tmp_path, write_clip):
    def break_down(k):
        if k == 5:
            raise ZeroDivisionError

    clip = write_clip(tmp_path / "a.mp4", n=9)
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError):
        run(clip, tmp_path / "out", at=break_down)
    assert len(rows_of(tmp_path / "out" / "angles.csv")) == 5
    assert read_provenance(tmp_path / "out")["state"] == "failed: ZeroDivisionError"
    assert threading.active_count() == before


def test_fault_before_the_first_frame_leaves_nothing(tmp_path, write_clip):
    def break_down(k):
        raise ZeroDivisionError

    clip = write_clip(tmp_path / "a.mp4", n=9)
    with pytest.raises(ZeroDivisionError):
        run(clip, tmp_path / "out", at=break_down)
    assert listing(tmp_path / "out") == []


def test_second_run_replaces_the_first_whole(tmp_path, write_clip):
    out = tmp_path / "out"
    run(write_clip(tmp_path / "a.mp4", n=9), out)
    run(write_clip(tmp_path / "b.mp4", n=4), out, overlay=False)
    assert listing(out) == [name for name in SHOWS if name != "overlay.mp4"]
    assert len(rows_of(out / "angles.csv")) == 4


def test_folder_of_others_is_left_alone(tmp_path, write_clip):
    out = tmp_path / "out"
    out.mkdir()
    (out / "angles.csv").write_text("mine")
    with pytest.raises(OutputError, match="no folder of ours"):
        run(write_clip(tmp_path / "a.mp4", n=2), out)
    assert (out / "angles.csv").read_text() == "mine"
    (out / "angles.csv").rename(out / "notes.csv")
    assert run(tmp_path / "a.mp4", out).exit_code == 0
    assert (out / "notes.csv").read_text() == "mine"


@pytest.mark.parametrize("where", ["a.mp4/out", "/proc/none/out"])
def test_output_folder_that_cannot_be_written(where, tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mp4", n=2)
    with pytest.raises(OutputError, match="cannot write in this folder"):
        run(clip, tmp_path / where)


def test_disk_full_while_writing_the_film_keeps_the_tables(tmp_path, write_clip, monkeypatch):
    def full(self, time_s, image):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("handtrack.output.overlay._Film.add", full)
    clip = write_clip(tmp_path / "a.mp4", n=30)
    with pytest.raises(OutputError, match=r"overlay\.mp4: cannot be written \(No space left"):
        run(clip, tmp_path / "out")
    assert 1 <= len(rows_of(tmp_path / "out" / "angles.csv")) <= 30
    assert "overlay.mp4" not in listing(tmp_path / "out")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot"),
        ("no toml at all", "not a TOML file"),
        ('format = "handtrack-camera"', "handtrack-hand"),
    ],
)
def test_hand_file_that_cannot_be_used(content, says, tmp_path, write_clip):
    hand = tmp_path / "my hand.toml"
    if content is not None:
        hand.write_text(content)
    with pytest.raises(InputError, match=says) as error:
        run(write_clip(tmp_path / "a.mp4", n=2), tmp_path / "out", hand=hand)
    assert "my hand.toml" in str(error.value)
    assert not (tmp_path / "out").exists()


def test_camera_of_another_shape_is_refused_by_name(tmp_path, write_clip):
    Camera.assumed_for(48, 64).save(tmp_path / "camera.toml")
    clip = write_clip(tmp_path / "a.mp4", n=2, size=(96, 64))
    with pytest.raises(InputError, match=r"camera\.toml: .*another shape"):
        run(clip, tmp_path / "out", camera=tmp_path / "camera.toml")


def test_camera_of_another_size_is_rescaled(tmp_path, write_clip):
    Camera(500, 500, 95.5, 63.5, 192, 128).save(tmp_path / "camera.toml")
    run(write_clip(tmp_path / "a.mp4", n=2), tmp_path / "out", camera=tmp_path / "camera.toml")
    record = read_provenance(tmp_path / "out")
    assert record["camera"]["fx_px"] == 250
    assert record["camera_assumed"] is False


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"start_frame": -1}, "--start-frame -1 is negative"),
        ({"seed": -1}, "--seed -1"),
        ({"particles": 0}, "--particles 0"),
        ({"max_megapixels": 0.001}, "--max-megapixels raises it"),
    ],
)
def test_settings_out_of_range(settings, says, tmp_path, write_clip):
    with pytest.raises(InputError, match=says):
        run(write_clip(tmp_path / "a.mp4", n=2), tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("options", [{"pixel_format": "yuv420p10le"}, {"size": (2, 2)}])
def test_odd_input_runs_through(options, tmp_path, write_clip):
    assert run(write_clip(tmp_path / "a.mp4", n=3, **options), tmp_path / "out").exit_code == 0


def test_grey_odd_sized_clip_of_one_frame(tmp_path, write_clip):
    clip = write_clip(tmp_path / "a.mkv", 1, (95, 63), codec="ffv1", pixel_format="gray")
    report = run(clip, tmp_path / "out")
    assert report.exit_code == 0
    assert report.counts.decoded == 1


def test_memory_does_not_grow_with_the_clip(tmp_path, write_clip):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]);"
        "from pathlib import Path; import test_run as t;"
        "t.run(Path(sys.argv[2]), Path(sys.argv[3]));"
        "from handtrack.account import peak_memory_mb; print(peak_memory_mb())"
    )
    peaks_mb = []
    for n in (20, 300):
        clip = write_clip(tmp_path / f"{n}.mp4", n=n, size=(640, 480))
        arguments = [os.path.dirname(__file__), str(clip), str(tmp_path / f"out{n}")]
        done = subprocess.run(
            [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True
        )
        peaks_mb.append(float(done.stdout.split()[-1]))
    assert peaks_mb[0] < 700
    # 280 frames more are 258 MB of pixels
    assert peaks_mb[1] - peaks_mb[0] < 40


def test_command_prints_its_last_line_and_returns_its_code(
    tmp_path, write_clip, monkeypatch, capsys
):
    monkeypatch.setattr(
        "handtrack.run.run_clip",
        lambda settings: run_clip(settings, lambda s, camera, shape: FakeTracker(camera)),
    )
    clip = write_clip(tmp_path / "a.mp4", n=3)
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", str(clip), "--no-overlay"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1].endswith("results in a.handtrack")
    assert err == ""
    assert json.loads((tmp_path / "a.handtrack" / "run.json").read_text())["exit_code"] == 0


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("none.mp4", None),
        ("0", None),
        ("empty.mp4", b""),
        ("text.mp4", b"words " * 99),
        (".", None),
    ],
)
def test_bad_clip_is_one_line_and_leaves_nothing(name, content, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert cli.main(["run", name]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert listing(tmp_path) == ([name] if content is not None else [])


def test_debug_pictures_of_chosen_frames(tmp_path, write_clip):
    clip, pictures = write_clip(tmp_path / "a.mp4", n=30), tmp_path / "Bilder" / "debug"
    run(clip, tmp_path / "out", debug=pictures)
    assert listing(pictures) == ["frame_000000.png", "frame_000025.png"]
    run(clip, tmp_path / "out", debug=tmp_path / "some", debug_frames=(3,))
    assert listing(tmp_path / "some") == ["frame_000003.png"]
    assert (tmp_path / "some" / "frame_000003.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(OutputError, match=r"frame_000000\.png: cannot be written"):
        run(clip, tmp_path / "out", debug=clip)
