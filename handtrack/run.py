"""``handtrack run``: a clip or a camera in, a folder of results out.

Decoding runs ahead in one thread and the overlay is drawn and encoded in another; nothing but the
counts, the timings and a few frames is kept, so memory does not grow with the length of the clip.
The loop itself is :mod:`handtrack.loop`.
"""

import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from handtrack.account import RunReport, TrackerLike, record_of
from handtrack.bench.tracks import read_truth
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.evidence.video import VideoInfo
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default as default_space
from handtrack.loop import BeginAgain, Loop, check_the_hand, result_of
from handtrack.output.folder import RunFolder
from handtrack.output.provenance import main_side, versions
from handtrack.output.report.curves import TrueMotion
from handtrack.records import FrameResult
from handtrack.settings import RunSettings
from handtrack.source import ClipSource, Source, is_camera, open_source
from handtrack.steady import Steadier
from handtrack.stop import stop_signals
from handtrack.threads import linear_algebra_on_one_thread
from handtrack.trajectory import Trajectory

BEGUN_AGAIN = "begun again"
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

    Where the hand turns out to be another than it was taken for, a clip is begun again.

    Raises
    ------
    InputError
        The clip, the hand, the camera or a setting cannot be used; nothing is written then.
    OutputError
        The results cannot be written; what could be is kept.
    """
    settings.check()
    try:
        return _opened(settings, settings, make)
    except BeginAgain as other:
        if not settings.quiet:
            print(f"{settings.clip}: {other}, as it turns out; once more", file=sys.stderr)
        return _opened(settings, _told(settings, other), make)


def _told(settings: RunSettings, hand: BeginAgain) -> RunSettings:
    """The settings with the hand that was found out."""
    return replace(settings, side=hand.side, facing=hand.facing)


def _opened(settings: RunSettings, told: RunSettings, make: MakeTracker) -> RunReport:
    with closing(
        open_source(settings.clip, settings.limits, settings.port, settings.open)
    ) as source:
        return _run(settings, told, make, source)


def _run(settings: RunSettings, told: RunSettings, make: MakeTracker, source: Source) -> RunReport:
    """Follow the hand that is ``told``; the record has the ``settings`` that were given."""
    info = source.info
    camera, tracker = _prepared(told, make, info)
    truth = _truth(settings)
    folder = RunFolder(settings.out or source.out)
    report = RunReport(info.path, folder.path, source.counts)
    size = (info.width_px, info.height_px)
    if settings.overlay:
        folder.film(size, info.time_base, settings.clip if info.has_audio else None)
    if settings.report:
        folder.report(size, getattr(tracker, "space", None) or default_space(), truth)
    begin = time.perf_counter()
    try:
        with linear_algebra_on_one_thread(), stop_signals() as asked:
            Loop(settings, tracker, camera, folder, report)(source, asked)
    except BeginAgain:
        report.state = BEGUN_AGAIN
        raise
    except BaseException as error:
        stopped = isinstance(error, KeyboardInterrupt)
        report.state = "interrupted" if stopped else f"failed: {type(error).__name__}"
        raise
    finally:
        some = report.counts.decoded and report.state != BEGUN_AGAIN
        if some or report.state == "complete":
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
    try:
        results, camera, tracker, info = _followed(chosen, make)
    except BeginAgain as other:
        results, camera, tracker, info = _followed(_told(chosen, other), make)
    provenance = {
        "clip": info.path.name,
        "hand_calibrated": tracker.shape.calibrated,
        "camera_assumed": camera.assumed,
        "versions": versions(),
    }
    return Trajectory.from_results(results, provenance)


def _followed(
    settings: RunSettings, make: MakeTracker
) -> tuple[list[FrameResult], Camera, TrackerLike, VideoInfo]:
    """The steadied answers of a clip, and what they are from."""
    source = ClipSource(settings.clip, settings.limits)
    camera, tracker = _prepared(settings, make, source.info)
    steadier: Steadier[None] = Steadier(settings.steady_s, camera)
    results: list[FrameResult] = []
    with closing(source.frames()) as frames, linear_algebra_on_one_thread():
        for frame in frames:
            result = result_of(frame, settings, tracker)
            check_the_hand(tracker)
            results += [steady for steady, _ in steadier.push(result, tracker.shape, None)]
    results += [steady for steady, _ in steadier.flush()]
    return results, camera, tracker, source.info


def _prepared(
    settings: RunSettings, make: MakeTracker, info: VideoInfo
) -> tuple[Camera, TrackerLike]:
    """Everything else that can be refused before a frame is tracked."""
    camera = _camera(settings, info)
    shape = HandShape.load(settings.hand) if settings.hand else None
    return camera, make(settings, camera, shape)


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
