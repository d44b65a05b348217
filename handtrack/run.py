"""``handtrack run``: a clip or a camera in, a folder of results out.

The loop is five lines: read a frame, track it, count it, write it, show how far we are. Decoding
runs ahead in one thread and the overlay is drawn and encoded in another; nothing but the counts
and the timings is kept, so memory does not grow with the length of the clip.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from tqdm import tqdm

from handtrack.account import RunReport, TrackerLike, record_of
from handtrack.bench.tracks import read_truth
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.evidence.orientation import Image
from handtrack.evidence.video import Limits, VideoInfo
from handtrack.first_run import word_if_slow
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default as default_space
from handtrack.layers import layers_of, seen_by
from handtrack.output.folder import RunFolder
from handtrack.output.provenance import main_side, versions
from handtrack.output.report.curves import TrueMotion
from handtrack.picture import drawn
from handtrack.records import Frame, FrameResult, Status
from handtrack.source import ClipSource, Source, is_camera, open_source
from handtrack.stages import stage_picture, write_picture
from handtrack.stop import StopAsked, stop_signals
from handtrack.threads import linear_algebra_on_one_thread
from handtrack.trajectory import Trajectory

#: Pictures for --debug are made of every so many frames.
EVERY_DEBUG_FRAME = 25


@dataclass(frozen=True)
class RunSettings:
    """Follow the hand in a clip: tables of angles and keypoints, and an overlay film.

    Writes angles.csv, keypoints.csv, motion.bvh, overlay.mp4, report.html, hand.toml, camera.toml
    and run.json.
    Exit code: 0 complete, 2 bad input, 3 cannot write, 4 no hand found, 5 some frames could not be
    decoded, 130 interrupted (what was done is kept).
    """

    clip: tyro.conf.Positional[Path]
    """A video file, or the number of a camera (0 is the first)."""
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
    report: bool = True
    """Make report.html and the report_files beside it."""
    truth: Path | None = None
    """The truth of a synthetic clip (truth.npz or its folder), for the report to compare with."""
    quiet: bool = False
    """No progress bar."""
    debug: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for pictures of every stage; --debug alone only shows tracebacks of errors."""
    debug_frames: tuple[int, ...] = ()
    """Frames to make those pictures of; default: every 25th."""
    max_megapixels: float = 40.0
    """Refuse larger frames."""
    max_minutes: float = 180.0
    """Refuse longer clips; a camera ends there."""
    port: int = 8642
    """Of the page that shows a camera's picture; 0 takes a free one."""
    open: bool = False
    """Open that page in the browser."""
    config: Path | None = None
    """A TOML file with any of these settings; the command line beats it."""

    def __call__(self) -> int:
        """Run, print the last line, return the exit code."""
        report = run_clip(self)
        print(report.last_line)
        return report.exit_code

    @property
    def limits(self) -> Limits:
        """What is refused before anything is allocated."""
        return Limits(self.max_megapixels, self.max_minutes)

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


#: Makes the tracker for the settings, the camera and the hand, if one is given.
MakeTracker = Callable[[RunSettings, Camera, HandShape | None], TrackerLike]


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
    return Tracker(chosen, camera, shape, default(), calibrate_hand)


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
    with closing(
        open_source(settings.clip, settings.limits, settings.port, settings.open)
    ) as source:
        return _run(settings, make, source)


def _run(settings: RunSettings, make: MakeTracker, source: Source) -> RunReport:
    info = source.info
    camera, tracker = _prepared(settings, make, info)
    truth = _truth(settings)
    folder = RunFolder(settings.out or source.out)
    report = RunReport(info.path, folder.path, source.counts)
    if settings.overlay:
        size = (info.width_px, info.height_px)
        folder.film(size, info.time_base, settings.clip if info.has_audio else None)
    if settings.report:
        size = (info.width_px, info.height_px)
        folder.report(size, getattr(tracker, "space", None) or default_space(), truth)
    begin = time.perf_counter()
    try:
        with linear_algebra_on_one_thread(), stop_signals() as asked:
            _track(source, settings, tracker, camera, folder, report, asked)
    except BaseException as error:
        stopped = isinstance(error, KeyboardInterrupt)
        report.state = "interrupted" if stopped else f"failed: {type(error).__name__}"
        raise
    finally:
        if report.counts.decoded or report.state == "complete":
            elapsed_s = time.perf_counter() - begin
            record = record_of(settings, info, camera, tracker, report, elapsed_s)
            extra = _files_for_the_next_run(tracker, camera)
            folder.finish(record, tracker.shape, main_side(report.sides), extra)
        else:
            folder.discard()
    return report


def track(clip: str | Path, make: MakeTracker = make_tracker, **settings: Any) -> Trajectory:
    """The trajectory of the hand in a clip; nothing is written.

    Parameters
    ----------
    clip : str or Path
        A video file.
    make : callable, optional
        Makes another tracker than the settings ask for.
    **settings
        Fields of :class:`RunSettings`; those about outputs do nothing here.

    Raises
    ------
    InputError
        The clip, the hand, the camera or a setting cannot be used.
    """
    chosen = RunSettings(Path(clip), **settings)
    chosen.check()
    if is_camera(chosen.clip):
        raise InputError(f"camera {clip}: has no end; Tracker.step follows it frame by frame")
    source = ClipSource(chosen.clip, chosen.limits)
    camera, tracker = _prepared(chosen, make, source.info)
    with closing(source.frames()) as frames, linear_algebra_on_one_thread():
        results = [_result(frame, chosen, tracker) for frame in frames]
    provenance = {
        "clip": source.info.path.name,
        "hand_calibrated": tracker.shape.calibrated,
        "camera_assumed": camera.assumed,
        "versions": versions(),
    }
    return Trajectory.from_results(results, provenance)


def _prepared(
    settings: RunSettings, make: MakeTracker, info: VideoInfo
) -> tuple[Camera, TrackerLike]:
    """Everything else that can be refused before a frame is tracked."""
    camera = _camera(settings, info)
    shape = HandShape.load(settings.hand) if settings.hand else None
    return camera, make(settings, camera, shape)


def _track(
    source: Source,
    settings: RunSettings,
    tracker: TrackerLike,
    camera: Camera,
    folder: RunFolder,
    report: RunReport,
    asked: StopAsked,
) -> None:
    """The loop over the frames."""
    off = settings.quiet or not sys.stderr.isatty()
    total = report.counts.container
    with (
        closing(source.frames()) as frames,
        tqdm(total=total, unit="frame", disable=off) as bar,
        word_if_slow(bar),
    ):
        for frame in _timed(frames, report.timings_ms["wait for frame"]):
            begin = time.perf_counter()
            result = _result(frame, settings, tracker)
            tracked = time.perf_counter()
            report.counts.add(result.status)
            report.sides[result.side] += 1
            draw = partial(drawn, frame, result, tracker.shape, camera)
            folder.add(result, source.shown(draw))
            layers = partial(layers_of, seen_by(tracker, frame.index), result, camera)
            folder.show(result, frame.image, layers, 1e3 * (tracked - begin))
            if settings.debug is not None and _is_chosen(settings, frame):
                picture = _stages(frame, result, tracker, camera)
                write_picture(settings.debug / f"frame_{frame.index:06d}.png", picture)
            report.timings_ms["track"].append(1e3 * (tracked - begin))
            report.timings_ms["hand over"].append(1e3 * (time.perf_counter() - tracked))
            bar.update()
            if asked:
                report.state = source.state_when_stopped
                return


def _result(frame: Frame, settings: RunSettings, tracker: TrackerLike) -> FrameResult:
    if frame.image is None:
        return FrameResult.unknown(frame.index, frame.time_s, Status.UNDECODABLE)
    if frame.index < settings.start_frame:
        return FrameResult.unknown(frame.index, frame.time_s)
    return tracker.step(frame)


def _is_chosen(settings: RunSettings, frame: Frame) -> bool:
    """Whether pictures of this frame's stages are wanted."""
    if settings.debug_frames:
        return frame.index in settings.debug_frames
    return frame.index % EVERY_DEBUG_FRAME == 0


def _stages(frame: Frame, result: FrameResult, tracker: TrackerLike, camera: Camera) -> Image:
    """The picture of a frame's stages."""
    evidence = getattr(tracker, "last_evidence", None) if result.side else None
    return stage_picture(evidence, drawn(frame, result, tracker.shape, camera))


def _truth(settings: RunSettings) -> TrueMotion | None:
    if settings.truth is None:
        return None
    path = settings.truth / "truth.npz" if settings.truth.is_dir() else settings.truth
    truth = read_truth(path)
    return TrueMotion(truth.theta, truth.keypoints_px)


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


def _timed(frames: Iterator[Frame], into: list[float]) -> Iterator[Frame]:
    """The frames; how long each was waited for goes into ``into``."""
    while True:
        begin = time.perf_counter()
        frame = next(frames, None)
        if frame is None:
            return
        into.append(1e3 * (time.perf_counter() - begin))
        yield frame
