"""The whole way from scene to score, with trackers whose errors are known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from handtrack.bench import suite
from handtrack.bench.commands import Bench
from handtrack.bench.suite import Result, Trial, as_document, run_suite, summarise, trials
from handtrack.bench.table import MAIN, as_text, paper_table
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.records import FrameResult, Status
from handtrack.run import run_clip
from synth.cache import ClipCache
from synth.clip import Truth
from synth.commands import Synth
from synth.scene import Scene


class Oracle:
    """A tracker that knows the truth, and may tell it late or put the digits in a wrong order."""

    def __init__(self, truth: Truth, late: int = 0, order: tuple[int, ...] = (0, 1, 2, 3, 4)):
        self.truth, self.late, self.order = truth, late, order
        self.shape = HandShape.default()
        self.timings_ms: dict[str, list[float]] = {}

    def step(self, frame):
        k = max(frame.index - self.late, 0)
        t = self.truth
        columns = [0, *(1 + 4 * d + j for d in self.order for j in range(4))]
        return FrameResult(
            index=frame.index,
            time_s=frame.time_s,
            status=Status.TRACKED,
            side=t.side,
            confidence=1.0,
            ess=1.0,
            R=t.R[k],
            t_mm=t.t_mm[k],
            theta=t.theta[k],
            theta_std=np.full(20, 0.1),
            keypoints_px=t.keypoints_px[k][columns],
            keypoints_mm=t.keypoints_mm[k][columns],
        )


@pytest.fixture(scope="module")
def render(tmp_path_factory):
    return ClipCache(tmp_path_factory.mktemp("clips"), frames=48)


def scores_of(monkeypatch, render, out, **faults):
    truth = Truth.load(render("paper", 0) / "truth.npz")

    def run_oracle(settings):  # as it says: its points are the true hand's, not the default's
        return run_clip(replace(settings, steady_s=0.0), lambda *_: Oracle(truth, **faults))

    monkeypatch.setattr(suite, "run_clip", run_oracle)
    return next(run_suite([Trial("paper", 0)], render, out)).scores


def test_the_truth_scores_nothing(monkeypatch, render, tmp_path):
    got = scores_of(monkeypatch, render, tmp_path)
    assert got["keypoints_px"] < 0.01  # the tables' decimals
    assert got["bend_deg"] < 0.01
    assert got["palm_deg"] < 0.01
    assert got["coverage_90"] == got["tracked_share"] == 1.0
    assert got["jitter_deg"] == pytest.approx(got["jitter_truth_deg"], abs=0.01)
    assert got["track_ms"] > 0


def test_a_late_tracker_is_caught(monkeypatch, render, tmp_path):
    got = scores_of(monkeypatch, render, tmp_path, late=1)
    assert got["lag_frames"] == pytest.approx(1.0, abs=0.2)
    assert got["bend_deg"] > 0.5


def test_shuffled_digits_are_caught(monkeypatch, render, tmp_path):
    got = scores_of(monkeypatch, render, tmp_path, order=(0, 2, 1, 4, 3))
    assert got["keypoints_px"] > 10
    assert got["bend_deg"] > 3


def test_two_jobs_give_what_one_gives(tmp_path):
    render, todo = ClipCache(tmp_path / "clips", frames=12), [Trial("paper", s) for s in (0, 1)]
    results = {}
    for jobs in (1, 2):
        assert [r.trial for r in run_suite(todo, render, tmp_path / f"{jobs}", jobs=jobs)] == todo
        files = sorted((tmp_path / f"{jobs}").glob("*/*.csv"))
        results[jobs] = [(f.relative_to(tmp_path / f"{jobs}"), f.read_bytes()) for f in files]
    assert len(results[1]) == 4
    assert results[1] == results[2]


def test_the_hand_that_is_handed_over(tmp_path):
    clip, out = tmp_path / "clip", tmp_path / "out" / "a"
    assert suite._hand_file("calibrated", clip, out) is None
    assert suite._hand_file("true", clip, out) == clip / "shape.toml"
    default = suite._hand_file("default", clip, out)
    assert HandShape.load(default).length_mm.tolist() == HandShape.default().length_mm.tolist()


def test_clips_are_rendered_once_and_again_when_the_scene_changes(render):
    made = render("paper", 0)
    before = (made / "clip.mp4").stat().st_mtime_ns
    assert render("paper", 0) == made
    assert (made / "clip.mp4").stat().st_mtime_ns == before
    assert render("paper", 1) != made
    assert Scene.load(made / "scene.toml").motion.frames == 48
    assert replace(render, frames=2)("paper", 0) != made


def test_summary_and_tables():
    scores = {"bend_deg": 4.0, "x_px": 1.0, "coverage_90": float("nan")}
    results = [Result(Trial("clean", s), scores | {"bend_deg": 4.0 + s}) for s in range(3)]
    row = summarise(results)[0]
    assert row["seeds"] == 3
    assert row["scores"]["bend_deg"] == {"median": 5.0, "low": 4.0, "high": 6.0}
    assert row["scores"]["coverage_90"] is None
    text = as_text([row], MAIN)
    assert "5.00+-1.00" in text
    assert text.splitlines()[1].startswith("clean      refined")
    assert "3.98" in paper_table([row])
    assert json.loads(json.dumps(as_document(results)))["rows"][0]["coverage_90"] is None


def test_trials_go_clip_by_clip():
    todo = trials(("a", "b"), range(2), ("refined", "paper"))
    assert [t.name for t in todo[:3]] == ["a-0-refined", "a-0-paper", "a-1-refined"]
    assert len(todo) == 8


def test_another_tracker_is_put_in_the_same_table(render, tmp_path, capsys, monkeypatch):
    scores_of(monkeypatch, render, tmp_path, late=2)
    other = tmp_path / "other.csv"
    other.write_text((tmp_path / "paper-0-refined" / "keypoints.csv").read_text())
    truth = render("paper", 0) / "truth.npz"
    code = Bench(keypoints=other, truth=truth, out=tmp_path / "b")()
    assert code == 0
    assert "other" in capsys.readouterr().out
    row = json.loads((tmp_path / "b" / "bench.json").read_text())["rows"][0]
    assert row["lag_frames"] == pytest.approx(2.0, abs=0.2)
    with pytest.raises(InputError, match="--truth"):
        Bench(keypoints=other)()


@pytest.mark.parametrize(
    ("bench", "said"),
    [
        (Bench(suite="x"), "no suite"),
        (Bench(seeds=0), "--seeds"),
        (Bench(jobs=0), "--jobs"),
        (Bench(conditions=("x",)), "x"),
    ],
)
def test_bad_requests_are_one_line(bench, said, tmp_path):
    with pytest.raises(InputError, match=said):
        replace(bench, out=tmp_path)()


def test_synth_makes_a_ready_scene(tmp_path, capsys):
    assert Synth("paper", out=tmp_path / "p", frames=2, seed=3, quiet=True)() == 0
    assert "2 frames" in capsys.readouterr().out
    with pytest.raises(InputError, match="no scene named 'papper'"):
        Synth("papper", out=tmp_path / "q")()


def test_fingers_replay_the_recordings_in_turn(tmp_path, shared):
    names = ("cup1_right.bvh", "mug1_right.bvh")
    recordings = tuple(shared / "data/manipnet" / name for name in names)
    render = ClipCache(tmp_path, frames=30, recordings=recordings)
    theta = [Truth.load(render("paper", seed) / "truth.npz").theta for seed in (0, 1)]
    own = Truth.load(ClipCache(tmp_path, frames=30)("paper", 0) / "truth.npz").theta
    assert np.abs(theta[0][-1] - own[-1]).max() > 0.1
    assert np.abs(theta[0][-1] - theta[1][-1]).max() > 0.1
