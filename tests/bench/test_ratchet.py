"""Accuracy may only improve; and the comparison itself can fail."""

import copy
from pathlib import Path

import pytest

from handtrack.bench.ratchet import read_baseline, worsened, write_baseline
from handtrack.bench.suite import SUITES, run_suite, summarise, trials
from handtrack.errors import InputError
from synth.cache import ClipCache
from synth.render import NoGLError

BASELINE = Path(__file__).parents[1] / "baseline.json"
#: What the baseline was made with: handtrack bench --suite reduced --seeds 6 --frames 60.
SEEDS, FRAMES = 6, 60


def row(bend: float, share: float = 1.0, spread: float = 0.0) -> dict:
    def score(x: float) -> dict:
        return {"median": x, "low": x - spread / 2, "high": x + spread / 2}

    return {
        "condition": "clean",
        "method": "refined",
        "seeds": 2,
        "scores": {"bend_deg": score(bend), "tracked_share": score(share), "palm_deg": None},
    }


@pytest.mark.parametrize(
    ("before", "after", "complaints"),
    [
        (row(5.0), row(5.4), 0),
        (row(5.0), row(5.6), 1),
        (row(5.0, spread=2.0), row(6.9), 0),
        (row(5.0, spread=2.0), row(7.1), 1),
        (row(5.0), row(2.0), 0),
        (row(5.0, share=1.0), row(5.0, share=0.9), 1),
        (row(5.0, share=0.9), row(5.0, share=1.0), 0),
    ],
)
def test_worse_is_worse(before, after, complaints):
    assert len(worsened([after], [before])) == complaints


def test_the_range_of_many_seeds_counts_less():
    few, many = row(5.0, spread=2.0), {**row(5.0, spread=2.0), "seeds": 8}
    assert len(worsened([row(6.5)], [few])) == 0
    assert len(worsened([row(6.5)], [many])) == 1
    assert len(worsened([row(5.9)], [many])) == 0


def test_a_score_that_is_gone_is_worse():
    gone = copy.deepcopy(row(5.0))
    gone["scores"]["bend_deg"] = None
    assert "missing" in worsened([gone], [row(5.0)])[0]
    assert len(worsened([], [row(5.0)])) == 2


def test_a_baseline_is_written_and_read(tmp_path):
    write_baseline([row(5.0)], tmp_path / "b.json")
    assert worsened([row(5.0)], read_baseline(tmp_path / "b.json")) == []
    (tmp_path / "c.json").write_text("[]")
    for name in ("c.json", "d.json"):
        with pytest.raises(InputError, match=name):
            read_baseline(tmp_path / name)


@pytest.mark.ratchet
@pytest.mark.slow
def test_accuracy_is_not_worse_than_the_baseline(tmp_path):
    todo = trials(SUITES["reduced"], range(SEEDS), ("refined",))
    try:
        render = ClipCache(tmp_path / "clips", FRAMES)
        results = list(run_suite(todo, render, tmp_path, jobs=2))
    except NoGLError as error:
        pytest.skip(str(error))
    assert worsened(summarise(results), read_baseline(BASELINE)) == []
