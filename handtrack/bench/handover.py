"""The command ``handtrack bench handover``: the hand-over paper's figures, measured.

Without recordings everything runs on the alphabet that ships; ``--recordings`` adds ManipNet clips
held out, real markers left out one at a time, and recorded gestures.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from tqdm import tqdm

from handtrack.bench.handover_page import split_parts, study_parts
from handtrack.bench.handover_speed import measure_speed
from handtrack.bench.handover_splits import over_splits
from handtrack.bench.handover_study import (
    PAPER,
    Score,
    Study,
    by_components,
    leave_one_out_mm,
    marker_sets,
    score,
    study,
    with_and_without_pca,
)
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.mocap import page
from handtrack.mocap.database import Clip, clip_of, read_clip, shipped_clip
from handtrack.mocap.hand_motion import hand_motion
from handtrack.mocap.marker_io import read_markers
from handtrack.mocap.marker_sets import marker_set
from handtrack.mocap.ranking import rank
from handtrack.mocap.recordings import read_leap, resampled
from handtrack.output.files import open_whole, output_folder

CLIPS = ("cube_med2", "cup1", "cyl_med3", "mug1", "mug3", "teapot2")
#: The pair that is shown in full; every other pair is in the table over all splits.
TEST = ("mug1", "mug3")
DFKI_ROOT = ("hand_top", "hand_left", "hand_right")
DFKI_HAND = tuple(
    f"{d}_{p}" for d in ("thumb", "index", "middle", "ring", "little") for p in ("middle", "tip")
)
LEAP_TEST = ("gun", "wave")
WORDS = ("girl", "walk", "counting", "gestures")


@dataclass(frozen=True)
class BenchHandover:
    """Measure the marker method: errors by components, by marker set, with and without PCA."""

    recordings: Path | None = None
    """Folder with manipnet/, dfki/ and leap/; without it, the alphabet that ships."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("bench-handover")
    """The folder for report.html and handover.json."""
    seed: int = 0
    """Seed of the performances and of the clusters."""
    only: str = ""
    """Measure only the studies whose name contains this."""
    stride: int = 8
    """Every so many frames of the ManipNet clips, which have 120 a second."""
    split_stride: int = 16
    """The same for the table over all splits."""
    speed: bool = False
    """Measure speed and memory too."""

    def __call__(self) -> int:
        """Measure, print, write."""
        if self.recordings is not None and not self.recordings.is_dir():
            raise InputError(f"{self.recordings}: no such folder of recordings")
        out = output_folder(self.out)
        document: dict[str, Any] = {"studies": {}, "seed": self.seed}
        parts: list[str] = []
        for s in [*self._shipped(), *self._recorded()]:
            if self.only not in s.name:
                continue
            print(f"\n{s.name}: {len(s.base.theta)} frames, tests {', '.join(map(_name, s.tests))}")
            measured = measure(s, np.random.default_rng(self.seed))
            document["studies"][s.name] = measured
            parts += study_parts(s, measured)
        if self.recordings is not None:
            document["splits"] = {
                side: self._splits(side, parts)
                for side in ("right", "left")
                if self.only in f"splits {side}"
            }
            document["leave_one_out_mm"] = self._left_out(parts)
        if self.speed:
            speed = measure_speed()
            document["speed"] = asdict(speed)
            parts += ["<h2>Speed</h2>", page.paragraph(speed.sentence)]
            print(f"\n{speed.sentence}")
        with open_whole(out / "handover.json") as file:
            file.write(json.dumps(document, indent=1) + "\n")
        with open_whole(out / "report.html") as file:
            file.write(page.page("The marker method, measured", parts))
        print(f"\n{out}: report.html, handover.json")
        return 0

    def _shipped(self) -> list[Study]:
        alphabet = shipped_clip("alphabet", self.seed, runs=2)
        tests = [shipped_clip(name, self.seed + 1 + k) for k, name in enumerate(WORDS)]
        gestures = shipped_clip("gestures", self.seed + 10, runs=2)
        return [
            study("alphabet", [alphabet], tests, stride=2),
            study("gestures to gestures", [gestures], [tests[-1]], stride=2),
        ]

    def _recorded(self) -> list[Study]:
        if self.recordings is None:
            return []
        found = []
        for side in ("right", "left"):
            clips = self._manipnet(side)
            learnt = [clips[n] for n in CLIPS if n not in TEST]
            held = [clips[n] for n in TEST]
            found.append(study(f"ManipNet {side}", learnt, held, self.stride))
        leap = {p.stem: _leap_clip(p) for p in sorted((self.recordings / "leap").glob("*.json"))}
        known = {n: c for n, c in leap.items() if c is not None}
        tests = [known[n] for n in LEAP_TEST if n in known]
        train = [c for n, c in known.items() if n not in LEAP_TEST]
        if tests and train:  # the poses that ship are of these recordings
            found.append(replace(study("Leap gestures", train, tests), borrows=False))
        return found

    def _manipnet(self, side: str) -> dict[str, Clip]:
        folder, full = (self.recordings or Path()) / "manipnet", marker_set("full13")
        return {n: read_clip(folder / f"{n}_{side}.bvh", full) for n in CLIPS}

    def _splits(self, side: str, parts: list[str]) -> dict[str, Any]:
        print(f"\nManipNet {side}, every two clips of six held out")
        with tqdm(total=15, unit="split", disable=not sys.stderr.isatty()) as bar:
            rows = over_splits(self._manipnet(side), self.split_stride, lambda _: bar.update())
        for name, row in rows.items():
            print(
                f"  {name:24s} mean {row.mean_deg:5.2f} ({row.channels_deg:.2f} by channels)  "
                f"median split {row.median_deg:5.2f}  "
                f"best {row.best_deg:5.2f}  worst {row.worst_deg:5.2f}  "
                f"in 90 %: {row.inside_90:.2f}"
            )
        parts += split_parts(side, rows)
        return {name: asdict(row) for name, row in rows.items()}

    def _left_out(self, parts: list[str]) -> Mapping[str, float]:
        markers = read_markers((self.recordings or Path()) / "dfki" / "recording.tsv")
        found = leave_one_out_mm(markers, DFKI_ROOT, DFKI_HAND)
        rows = [{"marker": m, "median error, mm": f"{e:.1f}"} for m, e in found.items()]
        parts += ["<h2>Real markers, each from the other nine</h2>", page.table(rows)]
        print("\nreal markers, each from the other nine, median error in mm")
        print("  ".join(f"{m} {e:.1f}" for m, e in found.items()))
        return found


def measure(s: Study, rng: np.random.Generator) -> dict[str, Any]:
    """Everything about one study, printed as it comes."""
    ranking = rank(s.base.labels, s.base.X_mm)
    rows = []
    for name, chosen, settings in marker_sets(s, rng):
        scores = [score(s, clip, chosen, settings) for clip in s.tests]
        rows.append(_row(name, chosen, scores, asdict(settings) if settings != PAPER else None))
        print("  " + _line(rows[-1]), flush=True)
    pca = {str(n): with_and_without_pca(s, ranking.top(n)) for n in (6, 3)}
    for n, found in pca.items():
        for name, values in found.items():
            print(f"  {n} markers, {name:40s} {_numbers(values)}")
    components = by_components(s, ranking.top(6))
    print("  components " + ", ".join(f"{k}: {np.mean(v):.2f}" for k, v in components.items()))
    return {
        "tests": [_name(c) for c in s.tests],
        "order": list(zip(ranking.order, ranking.share, strict=True)),
        "figure4": rows,
        "figure2": pca,
        "figure1": components,
    }


def _row(
    name: str, chosen: Sequence[str], scores: Sequence[Score], settings: Any
) -> dict[str, Any]:
    return {
        "set": name,
        "markers": list(chosen),
        "error_deg": [round(s.error_deg, 3) for s in scores],
        "mean_deg": round(float(np.mean([s.error_deg for s in scores])), 3),
        "channels_deg": round(float(np.mean([s.channels_deg for s in scores])), 3),
        "p95_deg": [round(s.p95_deg, 2) for s in scores],
        "lag_frames": [s.lag_frames for s in scores],
        "inside_90": [round(s.inside_90, 3) for s in scores],
        "settings": settings,
    }


def _line(row: Mapping[str, Any]) -> str:
    return (
        f"{row['set']:32s} {_numbers(row['error_deg'])}  mean {row['mean_deg']:5.2f} deg"
        f" ({row['channels_deg']:.2f} by channels)"
        f"  lag {max(map(abs, row['lag_frames']))}  in 90 %: {np.mean(row['inside_90']):.2f}"
        + (f"  {','.join(row['markers'])}" if len(row["markers"]) < 7 else "")
    )


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{v:5.2f}" for v in values)


def _name(clip: Clip) -> str:
    return clip.name


def _leap_clip(path: Path, rate_hz: float = 60.0) -> Clip | None:
    """A Leap recording of a right hand as a clip of the default hand; None if it is too short."""
    for recording in read_leap(path):
        if recording.side == "right" and recording.ok.sum() > rate_hz:
            times = recording.time_s[recording.ok]
            theta = resampled(recording, np.arange(times[0], times[-1], 1 / rate_hz))
            still = np.tile(np.eye(3), (len(theta), 1, 1)), np.zeros((len(theta), 3))
            motion = hand_motion(
                theta, *still, HandShape.default(), "right", 1 / rate_hz, np.eye(3)
            )
            return clip_of(path.stem, motion, marker_set("full13"))
    return None
