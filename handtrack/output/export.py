"""``handtrack export``: a run's motion for other programs.

===========  ====================  ==========================================================
``--to``     file                  what for
===========  ====================  ==========================================================
``bvh``      ``motion.bvh``        animation: a skeleton with metric offsets, upright in Blender
``trc``      ``keypoints.trc``     OpenSim: the 21 keypoints, mm, y up
``c3d``      ``keypoints.c3d``     motion capture programs: the same
``json``     ``keypoints.json``    web pages and scripts: pixels and mm of the 21 keypoints
``parquet``  ``tables.parquet``    data frames: both tables, units in the metadata
===========  ====================  ==========================================================

BVH, TRC and C3D have one frame rate. They get a frame for every row and the mean rate of the
clip; where the clip's own times stray from that by more than half a frame, a line says so, and
``--rate`` resamples the motion first. JSON and Parquet keep every frame's own time.

>>> formats_of("bvh, json")
('bvh', 'json')
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from handtrack.errors import InputError, NothingUsableError, OutputError
from handtrack.hand.shape import HandShape
from handtrack.mocap.bvh import write_bvh
from handtrack.mocap.hand_motion import hand_motion
from handtrack.mocap.motion import Motion
from handtrack.output.files import hidden_beside, output_folder, put_in_place
from handtrack.output.keypoints_json import write_keypoints_json
from handtrack.output.parquet import write_parquet
from handtrack.output.points import write_points
from handtrack.output.provenance import main_side
from handtrack.trajectory import Trajectory

#: Rate of a clip of one frame, which has none.
RATE_OF_ONE_FRAME_HZ = 30.0
#: Formats that know one frame rate only.
ONE_RATE = ("bvh", "trc", "c3d")
_PER_MM = {"mm": 1.0, "cm": 0.1, "m": 0.001}


@dataclass(frozen=True)
class Export:
    """Write a run's motion for other programs: BVH, TRC, C3D, JSON, Parquet.

    Files: motion.bvh, keypoints.trc, keypoints.c3d, keypoints.json, tables.parquet. All of them
    appear, or none.
    """

    folder: tyro.conf.Positional[Path]
    """The folder of a run."""
    to: str
    """Formats, with commas between: bvh, trc, c3d, json, parquet."""
    out: Path | None = None
    """Folder for the files; default: 'export' in the folder of the run."""
    rate: float | None = None
    """Resample to so many frames a second; default: every frame as it is."""
    unit: Literal["mm", "cm", "m"] = "mm"
    """Unit of length in the BVH; with m, Blender shows a hand of 0.19 units."""

    def __call__(self) -> int:
        """Write; the exit code is 0."""
        for path in export_run(self):
            print(path)
        return 0


@dataclass(frozen=True)
class Work:
    """A trajectory on its way out."""

    hand: Trajectory
    folder: Path
    rate_hz: float
    unit: str


def formats_of(text: str) -> tuple[str, ...]:
    """The formats that ``text`` names, each once.

    Raises
    ------
    InputError
        It names none, or one that is not known.
    """
    names = tuple(dict.fromkeys(word.strip().lower() for word in text.split(",") if word.strip()))
    unknown = [name for name in names if name not in WRITERS]
    if unknown or not names:
        said = f"unknown format '{unknown[0]}'" if unknown else "no format"
        raise InputError(f"--to {text}: {said}; there are {', '.join(WRITERS)}")
    return names


def export_run(settings: Export, say: Callable[[str], None] = print) -> list[Path]:
    """Write what the settings ask for, and return the files.

    Raises
    ------
    InputError
        A format is unknown, the folder is none of a run or damaged, or pyarrow is missing.
    NothingUsableError
        The hand is not known in any frame.
    OutputError
        A file cannot be written; none appears then.
    """
    names = formats_of(settings.to)
    if not settings.folder.is_dir():
        raise InputError(f"{settings.folder}: is no folder; give the folder of a run")
    hand = Trajectory.load(settings.folder)
    if hand.provenance.get("command") == "handover":
        raise InputError(
            f"{settings.folder}: is of a hand-over, in the axes of its markers; its motion.bvh is "
            "ready, and export takes the folder of a run"
        )
    if settings.rate is not None:
        if not 0 < settings.rate <= 1000:
            raise InputError(f"--rate {settings.rate:g}: wanted between 0 and 1000 frames a second")
        hand = hand.resample(settings.rate)
    if not (np.isfinite(hand.keypoints_mm).any() and np.isfinite(hand.theta).any()):
        raise NothingUsableError(f"{settings.folder}: the hand is not known in any frame")
    work = Work(hand, settings.folder, rate_hz(hand.time_s), settings.unit)
    if set(names) & set(ONE_RATE) and (note := uneven(hand.time_s, work.rate_hz)):
        say(note)
    out = output_folder(settings.out or settings.folder / "export")
    return _write_all([(out / WRITERS[name][0], WRITERS[name][1]) for name in names], work)


def rate_hz(time_s: NDArray[np.float64]) -> float:
    """Mean rate of the times ``(F,)``, to 0.001 Hz, for times are rounded too.

    >>> rate_hz(np.round(np.arange(10) / 30, 6))
    30.0
    """
    span_s = time_s[-1] - time_s[0] if len(time_s) > 1 else 0.0
    rate = (len(time_s) - 1) / span_s if span_s > 0 else RATE_OF_ONE_FRAME_HZ
    return max(round(float(rate), 3), 0.001)


def uneven(time_s: NDArray[np.float64], rate: float) -> str:
    """A line on times that are no even grid of this rate; empty where they are."""
    worst_s = float(np.abs(time_s - time_s[0] - np.arange(len(time_s)) / rate).max())
    if worst_s * rate <= 0.5:
        return ""
    return (
        f"frame times stray up to {worst_s:.3f} s from an even {rate:g} Hz, and BVH, TRC and C3D "
        "have one rate only: --rate resamples the motion"
    )


def _write_all(files: list[tuple[Path, Callable[[Path, Work], None]]], work: Work) -> list[Path]:
    """Write under hidden names; when all went well they get their own."""
    parts = [hidden_beside(path) for path, _ in files]
    try:
        for part, (path, write) in zip(parts, files, strict=True):
            try:
                write(part, work)
            except OutputError as error:
                raise OutputError(str(error).replace(str(part), str(path))) from error
        for part, (path, _) in zip(parts, files, strict=True):
            put_in_place(part, path)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)
    return [path for path, _ in files]


def _bvh(path: Path, work: Work) -> None:
    hand = work.hand
    side = main_side(Counter(hand.side.tolist()))
    shape = HandShape.load(work.folder / "hand.toml")
    step_s = round(1 / work.rate_hz, 9)
    motion = hand_motion(hand.theta, hand.palm_R, hand.palm_mm, shape, side, step_s)
    write_bvh(in_unit(motion, _PER_MM[work.unit]), path)


def in_unit(motion: Motion, per_mm: float) -> Motion:
    """The same motion with its lengths times ``per_mm``."""
    values = motion.values.copy()
    values[:, :3] *= per_mm  # the position of the root, which alone has one
    return replace(
        motion,
        offsets=motion.offsets * per_mm,
        end_offsets=motion.end_offsets * per_mm,
        values=values,
    )


def _points(path: Path, work: Work) -> None:
    write_points(work.hand, work.rate_hz, path)


def _json(path: Path, work: Work) -> None:
    write_keypoints_json(work.hand, path)


def _parquet(path: Path, work: Work) -> None:
    write_parquet(work.hand, path)


#: Format -> name of its file and what writes it.
WRITERS: dict[str, tuple[str, Callable[[Path, Work], None]]] = {
    "bvh": ("motion.bvh", _bvh),
    "trc": ("keypoints.trc", _points),
    "c3d": ("keypoints.c3d", _points),
    "json": ("keypoints.json", _json),
    "parquet": ("tables.parquet", _parquet),
}
