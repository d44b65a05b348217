"""Real clips have no truth: beside another tracker's keypoints, the methods on the same clip.

Distances are means over the 21 keypoints (and the five tips) of tracked frames, in palm lengths
(wrist to middle knuckle of the other tracker, frame by frame). The other tracker is an opinion:
where the two disagree, look at the picture.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from handtrack.bench.metrics import jitter_deg
from handtrack.errors import InputError
from handtrack.hand.skeleton import TIPS
from handtrack.output.table import read_tables
from handtrack.records import Status
from handtrack.run import RunSettings, run_clip
from handtrack.trajectory import Trajectory

Array = NDArray[np.float64]
Method = Literal["refined", "paper", "condensation", "random"]


@dataclass(frozen=True)
class BenchClip:
    """Methods side by side on a real clip, beside another tracker's keypoints."""

    clip: tyro.conf.Positional[Path]
    """A video file."""
    peer: Path
    """An npz with the other tracker's `kp2` (frames, 21, 2) in pixels."""
    out: Path
    """Folder for the results of every method."""
    methods: tuple[Method, ...] = ("refined", "paper", "condensation", "random")
    """What is compared."""
    spans: tuple[str, ...] = ()
    """Frames that count, as first:last; default: all."""
    seed: int = 0
    """Seed of all randomness: how much of a row is luck."""
    worst: int = 5
    """How many of the frames where the two disagree most are named."""

    def __call__(self) -> int:
        """Run the methods and print a row each."""
        other = read_peer(self.peer)
        counted = frames_in(self.spans, len(other))
        print("method        tracked   all   tips  jitter deg  frames/s  worst frames")
        for method in self.methods:
            begin = time.perf_counter()
            folder = self.out / method
            run_clip(
                RunSettings(clip=self.clip, out=folder, method=method, seed=self.seed, quiet=True)
            )
            seconds = time.perf_counter() - begin
            print(self._row(method, read_tables(folder), other, counted, seconds), flush=True)
        return 0

    def _row(
        self,
        method: str,
        found: Trajectory,
        other: Array,
        counted: NDArray[np.bool_],
        seconds: float,
    ) -> str:
        if len(found.frame) != len(other):
            raise InputError(
                f"{self.peer}: {len(other)} frames, the clip has {len(found.frame)}: another clip?"
            )
        tracked = found.is_status(Status.TRACKED)
        palm_px = np.linalg.norm(other[:, 9] - other[:, 0], axis=1)
        apart = np.linalg.norm(found.keypoints_px - other, axis=2) / palm_px[:, None]
        use = counted & tracked
        disagree = np.where(use, apart.mean(axis=1), -1)
        worst = np.argsort(-disagree)[: self.worst]
        named = ", ".join(str(int(found.frame[k])) for k in worst)
        jitter = jitter_deg(found.keypoints_mm, use)
        return (
            f"{method:<13} {tracked[counted].mean():6.1%}  {np.mean(apart[use]):.3f}  "
            f"{np.mean(apart[use][:, list(TIPS)]):.3f}  {jitter:10.2f}  "
            f"{len(other) / seconds:8.1f}  {named}"
        )


def read_peer(path: Path) -> Array:
    """Keypoints ``(F, 21, 2)`` in px of another tracker.

    Raises
    ------
    InputError
        The file cannot be read or holds no such array.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            points = np.asarray(arrays["kp2"], float)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: no keypoints 'kp2' to be read ({error})") from error
    if points.ndim != 3 or points.shape[1:] != (21, 2):
        raise InputError(f"{path}: 'kp2' has shape {points.shape}, wanted (frames, 21, 2)")
    return points


def frames_in(spans: tuple[str, ...], n: int) -> NDArray[np.bool_]:
    """Which of ``n`` frames lie in spans ``first:last``, both included; all if there are none.

    >>> frames_in(("1:2",), 4).tolist()
    [False, True, True, False]

    Raises
    ------
    InputError
        A span is not of that form.
    """
    if not spans:
        return np.ones(n, bool)
    inside = np.zeros(n, bool)
    for span in spans:
        try:
            first, last = (int(part) for part in span.split(":"))
        except ValueError as error:
            raise InputError(f"--spans {span}: wanted first:last, as in 0:183") from error
        inside[first : last + 1] = True
    return inside
