"""A benchmark run: conditions x seeds x methods, each a clip that is tracked and scored.

A *trial* is one clip followed by one method. Clips come from a ``render`` function (the commands
hand in ``synth``'s; nothing here knows how pictures are made), are tracked by the public
``handtrack run``, with the camera known and the hand calibrated from the clip, and are scored by
:mod:`handtrack.bench.metrics`. Of the seeds of a condition, medians and spread are reported.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handtrack.bench.metrics import Scores, score
from handtrack.bench.tracks import read_track, read_truth
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.output.provenance import versions
from handtrack.run import RunSettings, run_clip

#: Conditions of each suite, as ``synth`` names its scenes.
SUITES: dict[str, tuple[str, ...]] = {
    "paper": ("paper",),
    "smooth": (
        "clean",
        "turning",
        "left",
        "forearm",
        "fast",
        "clutter",
        "cold_start",
        "leaves_and_returns",
    ),
    "more": ("alike", "curls", "recorded", "back", "spheres"),
    "reduced": ("paper", "clean", "turning", "forearm"),
}
#: ``others``, hands that other makers modelled, are not among "all": their models do not ship.
SUITES["others"] = ("model", "people")
SUITES["all"] = SUITES["paper"] + SUITES["smooth"] + SUITES["more"]

#: Makes ``clip.mp4``, ``truth.npz``, ``camera.toml`` and ``shape.toml`` of a condition and a seed,
#: or finds them made, and returns their folder.
Render = Callable[[str, int], Path]


#: Where the tracker has the measures of the hand from.
HandGiven = Literal["calibrated", "true", "default"]


@dataclass(frozen=True)
class Trial:
    """One clip, followed by one method."""

    condition: str
    seed: int
    method: str = "refined"
    particles: int | None = None

    @property
    def name(self) -> str:
        """A name for files."""
        many = "" if self.particles is None else f"-{self.particles}"
        return f"{self.condition}-{self.seed}-{self.method}{many}"


@dataclass(frozen=True)
class Result:
    """What came of a trial."""

    trial: Trial
    scores: Scores


def trials(
    conditions: Sequence[str],
    seeds: Sequence[int],
    methods: Sequence[str],
    particles: int | None = None,
) -> list[Trial]:
    """All of them, clip by clip."""
    return [Trial(c, s, m, particles) for c in conditions for s in seeds for m in methods]


def run_trial(trial: Trial, clip: Path, out: Path, hand: HandGiven = "calibrated") -> Result:
    """Follow the clip in the folder ``clip`` and score what was found against its truth.

    Parameters
    ----------
    trial : Trial
    clip : Path
        Folder with the clip and its truth.
    out : Path
        Folder for the tracker's results.
    hand : str
        "calibrated" from the clip, or handed over: its "true" measures, or the "default" adult's.
    """
    settings = RunSettings(
        clip=clip / "clip.mp4",
        out=out,
        camera=clip / "camera.toml",
        hand=_hand_file(hand, clip, out),
        method=trial.method,  # type: ignore[arg-type]
        particles=trial.particles,
        seed=trial.seed,
        overlay=False,
        report=False,
        quiet=True,
    )
    report = run_clip(settings)
    truth = read_truth(clip / "truth.npz")
    scores = score(read_track(out / "keypoints.csv", len(truth)), truth)
    ms = report.timings_ms.get("track", [])
    scores["track_ms"] = float(np.median(ms)) if len(ms) else float("nan")
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    scores["fps"] = float(record.get("frames_per_second", np.nan))
    return Result(trial, scores)


def _hand_file(hand: HandGiven, clip: Path, out: Path) -> Path | None:
    if hand == "default":
        out.parent.mkdir(parents=True, exist_ok=True)
        path = out.parent / "default_hand.toml"
        HandShape.default().save(path)
        return path
    return clip / "shape.toml" if hand == "true" else None


def run_suite(
    todo: Sequence[Trial],
    render: Render,
    out: Path,
    hand: HandGiven = "calibrated",
    jobs: int = 1,
) -> Iterator[Result]:
    """The results of ``todo``, in that order; each leaves its tables in ``out``.

    With more than one job, so many are worked on at a time, each in a process of its own: the same
    results, but times of a machine that is shared. ``render`` must be picklable then.
    """
    work = partial(_render_and_run, render=render, out=out, hand=hand)
    if jobs == 1:
        yield from map(work, todo)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(work, todo)


def _render_and_run(trial: Trial, render: Render, out: Path, hand: HandGiven) -> Result:
    return run_trial(trial, render(trial.condition, trial.seed), out / trial.name, hand)


def summarise(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Median, least and most of every score, by condition and method.

    Returns
    -------
    list of dict
        ``condition, method, particles, seeds`` and of each score ``{median, low, high}``; a score
        that no seed has is None.
    """
    groups: dict[tuple[str, str, int | None], list[Scores]] = defaultdict(list)
    for result in results:
        t = result.trial
        groups[t.condition, t.method, t.particles].append(result.scores)
    return [
        {"condition": c, "method": m, "particles": p, "seeds": len(rows)}
        | {"scores": {name: _spread([row[name] for row in rows]) for name in rows[0]}}
        for (c, m, p), rows in groups.items()
    ]


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return None
    parts = {"median": np.median(known), "low": min(known), "high": max(known)}
    return {name: round(float(value), 4) for name, value in parts.items()}


def as_document(results: Sequence[Result]) -> dict[str, Any]:
    """Everything as it stands in ``bench.json``."""
    rows = [
        asdict(r.trial) | {k: round(v, 4) if np.isfinite(v) else None for k, v in r.scores.items()}
        for r in results
    ]
    return {"format": "handtrack-bench", "version": 1, "versions": versions(), "rows": rows} | {
        "summary": summarise(results)
    }


def conditions_of(suite: str, only: Sequence[str]) -> tuple[str, ...]:
    """The conditions asked for.

    Raises
    ------
    InputError
        There is no such suite.
    """
    if suite not in SUITES:
        raise InputError(f"no suite '{suite}'; there are {', '.join(SUITES)}")
    return tuple(only) or SUITES[suite]
