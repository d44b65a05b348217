"""``handtrack run``: a clip in, a folder of results out.

The loop is five lines: read a frame, track it, count it, write it, show how far we are. Decoding
runs ahead in one thread and the overlay is drawn and encoded in another; nothing but the counts
and the timings is kept, so memory does not grow with the length of the clip.
"""

import resource
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
import tyro
from tqdm import tqdm

from handtrack.camera import Camera
from handtrack.errors import (
    EXIT_INTERRUPTED,
    EXIT_SOME_UNDECODABLE,
    InputError,
    NothingUsableError,
)
from handtrack.evidence.orientation import Image
from handtrack.evidence.video import Limits, VideoInfo, probe, read_frames
from handtrack.hand.outline import outline_px
from handtrack.hand.shape import HandShape
from handtrack.hand.surface import Capsules
from handtrack.output.drawing import draw_result
from handtrack.output.folder import RunFolder
from handtrack.output.provenance import Counts, main_side, medians_ms, versions
from handtrack.records import Frame, FrameResult, Pose, Status
from handtrack.stop import StopAsked, stop_signals


class TrackerLike(Protocol):
    """What the loop needs of a tracker."""

    timings_ms: dict[str, list[float]]

    @property
    def shape(self) -> HandShape:
        """The hand that is tracked, as far as it is known by now."""
        ...

    def step(self, frame: Frame) -> FrameResult:
        """What is known of the hand in this frame."""
        ...


@dataclass(frozen=True)
class RunSettings:
    """Follow the hand in a clip: tables of angles and keypoints, and an overlay film.

    Writes angles.csv, keypoints.csv, overlay.mp4, hand.toml, camera.toml and run.json. Exit code:
    0 complete, 2 bad input, 3 cannot write, 4 no hand found, 5 some frames could not be decoded,
    130 interrupted (what was done is kept).
    """

    clip: tyro.conf.Positional[Path]
    """A video file."""
    out: Path | None = None
    """Folder for the results; default: the clip's name with .handtrack, here."""
    hand: Path | None = None
    """A hand file (hand.toml of an earlier run, say): no calibration then."""
    camera: Path | None = None
    """A camera file; without one a 58 degree view along the longer side is assumed."""
    side: Literal["auto", "right", "left"] = "auto"
    """Which hand it is; auto tells it by the thumb."""
    facing: Literal["palm", "back"] = "palm"
    """Which side of the hand the camera sees at the start."""
    method: Literal["refined", "paper", "condensation", "random"] = "refined"
    """How the pose is found; paper is the 2002 paper's, refined goes on from there."""
    particles: int | None = None
    """Particles per frame; default: the method's own number."""
    seed: int = 0
    """Seed of all random numbers."""
    start_frame: int = 0
    """Frame to begin at; the ones before it are lost."""
    overlay: bool = True
    """Make overlay.mp4."""
    quiet: bool = False
    """No progress bar."""
    debug: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for pictures of every stage; --debug alone only shows tracebacks of errors."""
    debug_frames: tuple[int, ...] = ()
    """Frames to make those pictures of; default: every 25th."""
    max_megapixels: float = 40.0
    """Refuse larger frames."""
    max_minutes: float = 180.0
    """Refuse longer clips."""
    config: Path | None = None
    """A TOML file with any of these settings; the command line beats it."""

    def __call__(self) -> int:
        """Run, print the last line, return the exit code."""
        report = run_clip(self)
        print(report.last_line)
        return report.exit_code

    def check(self) -> None:
        """Refuse what no flag's type can.

        Raises
        ------
        InputError
            A number is out of its range.
        """
        for name in ("start_frame", "seed"):
            if getattr(self, name) < 0:
                raise InputError(f"--{name.replace('_', '-')} {getattr(self, name)} is negative")
        if self.particles is not None and self.particles < 1:
            raise InputError(f"--particles {self.particles}: at least one is needed")


MakeTracker = Callable[[RunSettings, Camera, HandShape | None], TrackerLike]


@dataclass
class RunReport:
    """What came of a run."""

    clip: Path
    out: Path
    counts: Counts
    state: str = "complete"
    sides: Counter[str] = field(default_factory=Counter)
    timings_ms: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    @property
    def exit_code(self) -> int:
        """Zero only if everything the container promises was decoded and a hand was seen."""
        if self.state == "interrupted":
            return EXIT_INTERRUPTED
        if not self.counts.tracked:
            return NothingUsableError.exit_code
        return 0 if self.counts.complete else EXIT_SOME_UNDECODABLE

    @property
    def last_line(self) -> str:
        """Counts, and where the results are."""
        remark = "interrupted; " if self.state == "interrupted" else ""
        if not self.counts.tracked:
            remark += "no hand was found; "
        return f"{self.clip}: {remark}{self.counts.sentence}; results in {self.out}"


def make_tracker(settings: RunSettings, camera: Camera, shape: HandShape | None) -> TrackerLike:
    """The tracker that the settings ask for."""
    from calib.hand import calibrate_hand
    from handtrack.hand.space import default
    from handtrack.tracker import Tracker, TrackerSettings

    chosen = TrackerSettings(
        method=settings.method,
        side=settings.side,
        facing=settings.facing,
        particles=settings.particles,
        seed=settings.seed,
    )
    return Tracker(chosen, camera, shape, default(), None if shape else calibrate_hand)


def run_clip(settings: RunSettings, make: MakeTracker = make_tracker) -> RunReport:
    """Track a clip and write its folder.

    Raises
    ------
    InputError
        The clip, the hand, the camera or a setting cannot be used; nothing is written then.
    OutputError
        The results cannot be written; what could be is kept.
    """
    settings.check()
    limits = Limits(settings.max_megapixels, settings.max_minutes)
    info = probe(settings.clip, limits)
    camera = _camera(settings, info)
    shape = HandShape.load(settings.hand) if settings.hand else None
    tracker = make(settings, camera, shape)
    folder = RunFolder(settings.out or Path(f"{settings.clip.stem}.handtrack"))
    report = RunReport(settings.clip, folder.path, Counts(container=info.n_claimed))
    if settings.overlay:
        size = (info.width_px, info.height_px)
        folder.film(size, info.time_base, settings.clip if info.has_audio else None)
    begin = time.perf_counter()
    try:
        frames = read_frames(settings.clip, limits, info)
        with closing(frames), stop_signals() as asked:
            _track(frames, settings, tracker, camera, folder, report, asked)
    except BaseException as error:
        stopped = isinstance(error, KeyboardInterrupt)
        report.state = "interrupted" if stopped else f"failed: {type(error).__name__}"
        raise
    finally:
        if report.counts.decoded or report.state == "complete":
            elapsed_s = time.perf_counter() - begin
            record = _record(settings, info, camera, tracker, report, elapsed_s)
            folder.finish(record, _files_for_the_next_run(tracker, camera))
        else:
            folder.discard()
    return report


def _track(
    frames: Iterator[Frame],
    settings: RunSettings,
    tracker: TrackerLike,
    camera: Camera,
    folder: RunFolder,
    report: RunReport,
    asked: StopAsked,
) -> None:
    """The loop over the frames."""
    with tqdm(total=report.counts.container, unit="frame", disable=_no_bar(settings)) as bar:
        for frame in _timed(frames, report.timings_ms["wait for frame"]):
            begin = time.perf_counter()
            result = _result(frame, settings, tracker)
            tracked = time.perf_counter()
            report.counts.add(result.status)
            report.sides[result.side] += 1
            folder.add(result, partial(_drawn, frame, result, tracker.shape, camera))
            report.timings_ms["track"].append(1e3 * (tracked - begin))
            report.timings_ms["hand over"].append(1e3 * (time.perf_counter() - tracked))
            bar.update()
            if asked:
                report.state = "interrupted"
                return


def _result(frame: Frame, settings: RunSettings, tracker: TrackerLike) -> FrameResult:
    if frame.image is None:
        return FrameResult.unknown(frame.index, frame.time_s, Status.UNDECODABLE)
    if frame.index < settings.start_frame:
        return FrameResult.unknown(frame.index, frame.time_s)
    return tracker.step(frame)


def _drawn(frame: Frame, result: FrameResult, shape: HandShape, camera: Camera) -> Image:
    """The picture of a frame for the film; called in the film's thread."""
    if frame.image is None:
        image = np.zeros((camera.height_px, camera.width_px, 3), np.uint8)
    else:
        image = frame.image.copy()
    pose = Pose(result.R, result.t_mm)
    outline = outline_px(result.theta, pose, result.side, _surface(shape), camera)
    draw_result(image, result, outline)
    return image


@lru_cache(maxsize=2)
def _surface(shape: HandShape) -> Capsules:
    return Capsules(shape)


def _camera(settings: RunSettings, info: VideoInfo) -> Camera:
    if settings.camera is None:
        return Camera.assumed_for(info.width_px, info.height_px)
    try:
        return Camera.load(settings.camera).for_size(info.width_px, info.height_px)
    except InputError as error:
        text = str(error)
        named = text if str(settings.camera) in text else f"{settings.camera}: {text}"
        raise InputError(named) from error


def _files_for_the_next_run(
    tracker: TrackerLike, camera: Camera
) -> dict[str, Callable[[Path], None]]:
    """The hand and the camera that were used, as files that ``--hand`` and ``--camera`` take."""
    source = "assumed" if camera.assumed else "given"
    return {"hand.toml": tracker.shape.save, "camera.toml": partial(camera.save, source=source)}


def _record(
    settings: RunSettings,
    info: VideoInfo,
    camera: Camera,
    tracker: TrackerLike,
    report: RunReport,
    elapsed_s: float,
) -> dict[str, Any]:
    """What ``run.json`` says."""
    n = report.counts.decoded + report.counts.undecodable
    space = getattr(tracker, "space", None)
    return {
        "state": report.state,
        "exit_code": report.exit_code,
        "clip": {
            "name": info.path.name,
            "width_px": info.width_px,
            "height_px": info.height_px,
            "stored_width_px": info.stored_width_px,
            "stored_height_px": info.stored_height_px,
            "sample_aspect_ratio": info.sample_aspect_ratio,
            "rotation_applied_clockwise_deg": info.orientation.clockwise_deg,
            "mirror_applied": info.orientation.mirrored,
            "rate_hz": info.rate_hz,
            "duration_s": info.duration_s,
            "codec": info.codec,
            "pixel_format": info.pixel_format,
        },
        "counts": report.counts,
        "side": main_side(report.sides),
        "hand": {"calibrated": tracker.shape.calibrated, "source": tracker.shape.source},
        "camera": camera,
        "camera_assumed": camera.assumed,
        "dropped_basis_states": getattr(space, "dropped", None),
        "settings": settings,
        "seed": settings.seed,
        "versions": versions(),
        "frames_per_second": round(n / elapsed_s, 2),
        "peak_memory_mb": _peak_memory_mb(),
        "timings_ms": medians_ms(report.timings_ms | dict(tracker.timings_ms)),
    }


def _peak_memory_mb() -> float:
    """Largest resident size of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (2**20 if sys.platform == "darwin" else 2**10), 1)


def _timed(frames: Iterator[Frame], into: list[float]) -> Iterator[Frame]:
    """The frames; how long each was waited for goes into ``into``."""
    while True:
        begin = time.perf_counter()
        frame = next(frames, None)
        if frame is None:
            return
        into.append(1e3 * (time.perf_counter() - begin))
        yield frame


def _no_bar(settings: RunSettings) -> bool:
    return settings.quiet or not sys.stderr.isatty()
