"""What each choice of a whole tracker is worth: one taken back at a time, over whole clips.

Unlike :mod:`handtrack.bench.ablation` nothing is handed over here: the hand is calibrated from the
clip, the palm is found, and a choice that matters only once something went wrong can show it.
Answers are the frames' own, not steadied.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.bench.metrics import Scores, score
from handtrack.bench.tracks import Track, read_truth
from handtrack.camera import Camera
from handtrack.evidence.video import read_frames
from handtrack.judge import JudgeSettings
from handtrack.paper import PaperSettings
from handtrack.records import FrameResult, Status
from handtrack.refined import RefinedSettings
from handtrack.start import Calibrate
from handtrack.tracker import Tracker, TrackerSettings

#: So many frames apart, a look never comes.
NEVER = 10**9


def tracker_variants() -> dict[str, TrackerSettings]:
    """Settings by name: the default and the paper's method, each followed by what it is without."""
    default, paper = TrackerSettings(), TrackerSettings(method="paper")

    def refined(**changed: Any) -> TrackerSettings:
        return replace(default, refined=replace(RefinedSettings(), **changed))

    def published(**changed: Any) -> TrackerSettings:
        return replace(paper, paper=replace(PaperSettings(), **changed))

    never = JudgeSettings(check_every=NEVER, doubt_every=NEVER, turned_every=NEVER)
    return {
        "refined": default,
        "no hands at basis states": refined(snaps=0),
        "no pitched palms": refined(pitches=0),
        "no pull to where it faced": refined(facing_std_deg=0.0),
        "no other tilt": refined(tilt_share=0.0),
        "no second look": replace(default, judge=never),
        "paper": paper,
        "palm and fingers once": published(rounds=1),
        "no fingers to the palm": published(fingertips=False),
        "orthographic throughout": published(again=PaperSettings().icp),
    }


def ablate_tracker(
    clips: Sequence[Path], calibrate: Calibrate, variants: dict[str, TrackerSettings] | None = None
) -> Iterator[tuple[str, Scores]]:
    """Scores of every variant on every clip (folders as ``handtrack synth`` makes them)."""
    for name, settings in (variants or tracker_variants()).items():
        for clip in clips:
            yield name, run_tracker(clip, settings, calibrate)


def run_tracker(clip: Path, settings: TrackerSettings, calibrate: Calibrate) -> Scores:
    """Scores of one tracker on one clip whose camera is known."""
    camera = Camera.load(clip / "camera.toml")
    tracker = Tracker(settings, camera, calibrate=calibrate)
    with closing(read_frames(clip / "clip.mp4")) as frames:
        results = [tracker.step(frame) for frame in frames]
    return score(track_of(results), read_truth(clip / "truth.npz"))


def track_of(results: Sequence[FrameResult]) -> Track:
    """Consecutive results as what the metrics compare."""
    return Track(
        keypoints_px=np.array([r.keypoints_px for r in results]),
        keypoints_mm=np.array([r.keypoints_mm for r in results]),
        theta=np.array([r.theta for r in results]),
        theta_std=np.array([r.theta_std for r in results]),
        shown=np.array([r.status is Status.TRACKED for r in results]),
    )
