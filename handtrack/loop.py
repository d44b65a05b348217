"""The loop of ``handtrack run``: read a frame, track it, steady it, write it, show how far we are.

Answers are steadied before they are written, so each frame waits, with all that is to be shown of
it, until the frames that its mean takes in have come (:mod:`handtrack.steady`).
"""

import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from tqdm import tqdm

from handtrack.account import RunReport, TrackerLike
from handtrack.camera import Camera
from handtrack.errors import OutputError
from handtrack.evidence.evidence import Evidence
from handtrack.first_run import word_if_slow
from handtrack.hand.shape import HandShape
from handtrack.layers import Seen, layers_of, seen_by
from handtrack.output.folder import RunFolder
from handtrack.picture import drawn
from handtrack.records import Frame, FrameResult, Shown, Side, Status
from handtrack.settings import RunSettings
from handtrack.source import Source
from handtrack.stages import stage_picture, write_picture
from handtrack.steady import Steadier
from handtrack.stop import StopAsked

#: Pictures for --debug are made of every so many frames.
EVERY_DEBUG_FRAME = 25


class BeginAgain(Exception):  # noqa: N818 - no error
    """The hand is another than it was taken for: what was answered of this clip is wrong."""

    def __init__(self, side: Side, facing: Shown) -> None:
        super().__init__(f"begins with the {facing} of a {side} hand")
        self.side, self.facing = side, facing


@dataclass(frozen=True, eq=False)
class Step:
    """A frame that was tracked, and what is to be shown of it once its answer is steadied."""

    frame: Frame
    shape: HandShape
    seen: Seen | None
    evidence: Evidence | None
    ms: float


@dataclass(frozen=True)
class Loop:
    """Follows a source to its end, or until it is asked to stop, into a folder."""

    settings: RunSettings
    tracker: TrackerLike
    camera: Camera
    folder: RunFolder
    report: RunReport

    def __call__(self, source: Source, asked: StopAsked) -> None:
        """Run it; what was tracked before a fault is written too, if it can be."""
        steadier: Steadier[Step] = Steadier(self.settings.steady_s, self.camera)
        writable = True
        try:
            self._follow(source, asked, steadier)
        except (OutputError, BeginAgain):
            writable = False
            raise
        finally:
            for result, step in steadier.flush() if writable else ():
                self._hand_over(result, step, source)

    def _follow(self, source: Source, asked: StopAsked, steadier: Steadier[Step]) -> None:
        """Every frame, one after the other."""
        off = self.settings.quiet or not sys.stderr.isatty()
        total, timings = self.report.counts.container, self.report.timings_ms
        bar = tqdm(total=total, unit="frame", disable=off)
        with closing(source.frames()) as frames, bar, word_if_slow(bar):
            for frame in timed(frames, timings["wait for frame"]):
                result, step = self._track(frame)
                if source.can_begin_again:
                    check_the_hand(self.tracker)
                begin = time.perf_counter()
                for steady, earlier in steadier.push(result, step.shape, step):
                    self._hand_over(steady, earlier, source)
                timings["track"].append(step.ms)
                timings["hand over"].append(1e3 * (time.perf_counter() - begin))
                bar.update()
                if asked:
                    self.report.state = source.state_when_stopped
                    return

    def _track(self, frame: Frame) -> tuple[FrameResult, Step]:
        begin = time.perf_counter()
        result = result_of(frame, self.settings, self.tracker)
        ms = 1e3 * (time.perf_counter() - begin)
        evidence = None
        if self.settings.debug is not None and result.side:
            evidence = getattr(self.tracker, "last_evidence", None)
        seen = seen_by(self.tracker, frame.index)
        return result, Step(frame, self.tracker.shape, seen, evidence, ms)

    def _hand_over(self, result: FrameResult, step: Step, source: Source) -> None:
        """Count a frame, and give it to everything that is written."""
        self.report.counts.add(result.status)
        self.report.sides[result.side] += 1
        draw = partial(drawn, step.frame, result, step.shape, self.camera)
        self.folder.add(result, source.shown(draw))
        layers = partial(layers_of, step.seen, result, self.camera)
        self.folder.show(result, step.frame.image, layers, step.ms)
        debug = self.settings.debug
        if debug is not None and is_chosen(self.settings, step.frame):
            picture = stage_picture(step.evidence, draw())
            write_picture(debug / f"frame_{step.frame.index:06d}.png", picture)


def result_of(frame: Frame, settings: RunSettings, tracker: TrackerLike) -> FrameResult:
    """What is known of the hand in a frame, decoded or not, wanted or not."""
    if frame.image is None:
        return FrameResult.unknown(frame.index, frame.time_s, Status.UNDECODABLE)
    if frame.index < settings.start_frame:
        return FrameResult.unknown(frame.index, frame.time_s)
    return tracker.step(frame)


def check_the_hand(tracker: TrackerLike) -> None:
    """Nothing, unless the hand turned out to be another than it was taken for.

    Raises
    ------
    BeginAgain
        It did.
    """
    found = getattr(tracker, "found_out", None)
    if found is not None:
        raise BeginAgain(*found)


def is_chosen(settings: RunSettings, frame: Frame) -> bool:
    """Whether pictures of this frame's stages are wanted."""
    if settings.debug_frames:
        return frame.index in settings.debug_frames
    return frame.index % EVERY_DEBUG_FRAME == 0


def timed(frames: Iterator[Frame], into: list[float]) -> Iterator[Frame]:
    """The frames; how long each was waited for goes into ``into``."""
    while True:
        begin = time.perf_counter()
        frame = next(frames, None)
        if frame is None:
            return
        into.append(1e3 * (time.perf_counter() - begin))
        yield frame
