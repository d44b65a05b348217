"""``handtrack synth``, ``handtrack bench`` and ``handtrack demo``.

Here the makers of clips meet the tracker: :mod:`handtrack.bench` is handed a function that
renders, so that it need not know this package.
"""

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import tyro
from tqdm import tqdm

from handtrack.bench.comparison import compare
from handtrack.bench.metrics import score
from handtrack.bench.plots import plot_comparison
from handtrack.bench.ratchet import read_baseline, worsened, write_baseline
from handtrack.bench.suite import (
    Result,
    Trial,
    as_document,
    conditions_of,
    run_suite,
    summarise,
    trials,
)
from handtrack.bench.table import MAIN, as_text, paper_table, samples_table
from handtrack.bench.tracks import read_track, read_truth
from handtrack.errors import InputError, OutputError
from handtrack.hand.space import default as default_space
from handtrack.hand.surface import Capsules, Cardboard
from handtrack.run import RunSettings, run_clip
from synth.cache import ClipCache
from synth.clip import write_clip
from synth.render import NoGLError
from synth.scene import Scene

Method = Literal["refined", "paper", "condensation", "random"]


@dataclass(frozen=True)
class Synth:
    """Make a film of a hand whose every angle is known.

    Writes clip.mp4, truth.npz (angles, palm pose, keypoints, mask), shape.toml, camera.toml and
    scene.toml.
    """

    scene: tyro.conf.Positional[str]
    """A scene file, or the name of a ready scene (clean, turning, clutter, ...)."""
    out: Path | None = None
    """Folder for the results; default: the scene's name with .synth, here."""
    seed: int | None = None
    """Another seed than the scene's."""
    frames: int | None = None
    """Another length than the scene's."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Render; the exit code is 0."""
        is_file = self.scene.endswith(".toml") or Path(self.scene).is_file()
        scene = Scene.load(self.scene) if is_file else Scene.named(self.scene)
        if self.seed is not None:
            scene = replace(scene, seed=self.seed)
        if self.frames is not None:
            scene = replace(scene, motion=replace(scene.motion, frames=self.frames))
        out = self.out or Path(f"{Path(self.scene).stem}.synth")
        truth = write_clip(scene, out, progress=not self.quiet)
        print(f"{out / 'clip.mp4'}: {len(truth.theta)} frames, truth in {out / 'truth.npz'}")
        return 0


@dataclass(frozen=True)
class Bench:
    """Measure trackers against synthetic truth: a table, and bench.json.

    Renders every condition with several seeds, follows each clip as handtrack run does (camera
    known, hand calibrated from the clip), and reports medians over the seeds. With --keypoints
    any other tracker's table is scored against one truth.npz instead.
    """

    suite: str = "smooth"
    """paper, smooth, more, reduced or all."""
    conditions: tuple[str, ...] = ()
    """Only these, whatever the suite has."""
    seeds: int = 3
    """Clips per condition."""
    method: tuple[Method, ...] = ("refined",)
    """Methods to compare."""
    particles: int | None = None
    """Particles of the filters; by default each method's own number."""
    true_hand: bool = False
    """Hand over the true measures of the hand: no calibration."""
    frames: int | None = None
    """Another length for every clip."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""
    keypoints: Path | None = None
    """Another tracker's keypoints (CSV, columns as handtrack's keypoints.csv)."""
    truth: Path | None = None
    """The truth.npz that --keypoints is scored against."""
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
            conditions_of(self.suite, self.conditions), self.seeds, self.method, self.particles
        )
        if not todo:
            raise InputError(f"--seeds {self.seeds}: at least one is needed")
        render = ClipCache(self.clips or self.out / "clips", self.frames)
        hidden = self.quiet or not sys.stderr.isatty()
        runs = run_suite(todo, render, self.out, self.true_hand)
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
class Demo:
    """Make a clip, follow the hand in it, and say how far off the result is.

    Needs no input. Without OpenGL the clip shows the cardboard hand, which is drawn in software.
    """

    out: Path = Path("demo")
    """Folder for the clip and the results."""
    frames: int = 120
    """Length of the clip."""
    seed: int = 1
    """Seed of the clip."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Render, track, compare; the exit code is that of the tracking."""
        scene, clip = Scene.named("turning", self.seed), self.out / "clip"
        scene = replace(scene, motion=replace(scene.motion, frames=self.frames, tilt_deg=20.0))
        try:
            write_clip(scene, clip, progress=not self.quiet)
        except NoGLError as error:
            print(f"{error}; drawing the cardboard hand")
            scene = replace(scene, surface="cardboard", hand="average")
            write_clip(scene, clip, progress=not self.quiet)
        found = self.out / "found"
        report = run_clip(
            RunSettings(clip / "clip.mp4", out=found, camera=clip / "camera.toml", quiet=self.quiet)
        )
        print(report.last_line)
        truth = read_truth(clip / "truth.npz")
        print(_verdict(score(read_track(found / "keypoints.csv", len(truth)), truth)))
        for file, what in _WHERE_TO_LOOK.items():
            if (found / file).exists():
                print(f"  {found / file}: {what}")
        return report.exit_code


def _write_json(path: Path, document: Any) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


_WHERE_TO_LOOK = {
    "overlay.mp4": "what was found, drawn over the clip",
    "report.html": "the angles over time, in a browser",
    "angles.csv": "the table of angles",
    "motion.bvh": "the motion, for Blender",
}


def _verdict(scores: dict[str, float]) -> str:
    return (
        f"against the truth: angles between bones {scores['bend_deg']:.1f} deg, "
        f"palm {scores['palm_deg']:.1f} deg, keypoints {scores['keypoints_px']:.1f} px, "
        f"jitter {scores['jitter_deg']:.2f} deg (the hand's own {scores['jitter_truth_deg']:.2f}), "
        f"{100 * scores['tracked_share']:.0f} % of the frames tracked"
    )
