"""The loop: see, palm and fingers, report; and what happens when there is no hand.

One frame with a hand in track::

    image    the frame, flipped if the hand is a left one
    view     evidence in the window where the hand should be
    estimate the method's palm <-> fingers alternation from the prediction
    status   does the model explain the silhouette? else look for the hand anew

The tracked model is always a right hand; :mod:`handtrack.report` turns it into the hand as filmed.
"""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.doubt import is_due, look_again, recover
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import Evidence, see
from handtrack.evidence.silhouette import Segmenter, seen_by_shape
from handtrack.facing_test import FacingSettings, FacingTest
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.space import default as default_space
from handtrack.in_track import Method, Track
from handtrack.judge import (
    JudgeSettings,
    confidence,
    doubtful,
    drawn,
    overlap,
    share_seen,
    status_of,
)
from handtrack.layers import Seen
from handtrack.paper import PaperMethod, PaperSettings
from handtrack.proposals import hypotheses_near, shown_log_odds
from handtrack.records import (
    OTHER_SIDE,
    OTHER_WAY,
    Frame,
    FrameResult,
    Shown,
    Side,
    Status,
)
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings
from handtrack.report import result_of
from handtrack.searched import SearchedStart
from handtrack.seeds import facing_of
from handtrack.start import (
    Calibrate,
    Start,
    StartSettings,
    calibrated_start,
    recalibrated,
)
from handtrack.window import window_for

Image = NDArray[np.uint8]
#: The proposer is asked about a hand in track in one frame of so many.
ASK_EVERY = 2
#: Cosine of the angle to the camera's axis below which a palm is too much edge-on to say its side.
EDGE_ON = 0.4


@dataclass(frozen=True)
class TrackerSettings:
    """What the tracker is told."""

    method: Literal["refined", "paper", "condensation", "random"] = "refined"
    """How a frame is worked out."""
    side: Literal["auto", "right", "left"] = "auto"
    """Which hand it is; auto: told by the thumb."""
    facing: Literal["auto", "palm", "back"] = "auto"
    """Which side of the hand is shown at the start; auto: the palm, unless the picture says by and
    by that it is the back, where the hand's side is not told either."""
    particles: int | None = None
    """Particles of the filters; by default what the paper gives each."""
    seed: int = 0
    """Seed of all randomness."""
    start: StartSettings = field(default_factory=StartSettings)
    shown: FacingSettings = field(default_factory=FacingSettings)
    judge: JudgeSettings = field(default_factory=JudgeSettings)
    refined: RefinedSettings = field(default_factory=RefinedSettings)
    paper: PaperSettings = field(default_factory=PaperSettings)


class Tracker:
    """Follows one hand from frame to frame.

    Parameters
    ----------
    settings : TrackerSettings
    camera : Camera
        Of the clip as filmed.
    shape : HandShape, optional
        A calibrated hand; without one the shape is calibrated from an open palm if ``calibrate``
        is given, and the default adult hand is assumed before that.
    space : ConfigurationSpace, optional
        The shipped one by default.
    calibrate : optional
        ``calib.hand.calibrate_hand``, handed in by whoever may import it.
    """

    def __init__(
        self,
        settings: TrackerSettings,
        camera: Camera,
        shape: HandShape | None = None,
        space: ConfigurationSpace | None = None,
        calibrate: Calibrate | None = None,
    ) -> None:
        self.settings, self.camera, self.given, self.calibrate = settings, camera, shape, calibrate
        self.space = space or default_space()
        self.rng = np.random.default_rng(settings.seed)
        self.track: Track | None = None
        self.search: SearchedStart | None = None  # while no open palm starts the track
        self.side: str = settings.side  # what is told, or has been learned, or "auto"
        self.facing: Shown = "back" if settings.facing == "back" else "palm"  # as hands are shown
        auto = settings.side == "auto"
        self.shown = FacingTest(settings.shown) if auto and settings.facing == "auto" else None
        self.thumb = FacingTest(settings.shown) if auto else None
        self.found_out: tuple[Side, Shown] | None = None  # other than it was taken for
        self.last_evidence: Evidence | None = None
        self.seen: Seen | None = None  # of the last frame that was followed
        self.timings_ms: dict[str, list[float]] = defaultdict(list)

    def step(self, frame: Frame) -> FrameResult:
        """What is known of the hand in this frame; frames come in order of time.

        A hand that is not found is a status, no exception; ``examples/stream.py`` follows one.

        >>> tracker = Tracker(TrackerSettings(), Camera.assumed_for(64, 48))
        >>> grey = np.full((48, 64, 3), 90, np.uint8)  # RGB
        >>> tracker.step(Frame(index=0, time_s=0.0, image=grey)).status.sentence
        'the hand is not known in this frame'
        """
        if frame.image is None:
            return FrameResult.unknown(frame.index, frame.time_s, Status.UNDECODABLE)
        if self.track is None:
            with self._timed("start"):
                self._start(frame.image)
        if self.track is None:
            return FrameResult.unknown(frame.index, frame.time_s)
        return self._follow(frame, frame.image, self.track)

    @property
    def shape(self) -> HandShape:
        """The hand that is tracked."""
        if self.track is not None:
            return self.track.shape
        return self.given or HandShape.default()

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.timings_ms[stage].append(1e3 * (time.perf_counter() - begin))

    def _searcher(self, shape: HandShape) -> RefinedMethod:
        return RefinedMethod(shape, self.space, self.settings.refined)

    def _method(self, shape: HandShape, searcher: RefinedMethod) -> Method:
        s = self.settings
        if s.method == "refined":
            return searcher
        return PaperMethod(shape, self.space, s.refined, s.method, s.particles, s.paper)

    def _start(self, image: Image) -> None:
        """Begin a track on an open palm, or after some waiting on whatever fits well."""
        s = self.settings
        start: Start | None = None
        default = self.given or HandShape.default()
        silhouettes = cache(partial(Segmenter.bootstrap, image))  # looked for once, if asked for
        if self.calibrate is not None:
            start = calibrated_start(
                image,
                silhouettes(),
                self.camera,
                self.calibrate,
                default,
                self.side,
                self.facing,
                s.start,
                fit_shape=self.given is None,
            )
        if start is None:
            self.search = self.search or SearchedStart(
                self._searcher, default, self.side, self.facing, s.start
            )
            start = self.search(image, silhouettes, self.camera, self.rng)
        if start is not None:
            searcher = self._searcher(start.shape)
            method = self._method(start.shape, searcher)
            self.track = Track(start, searcher, method, side_told=self.side != "auto")
            self.search = None

    def _begin_anew(self, side: Side) -> None:
        """Forget the track: it is a hand of this side."""
        self.side, self.track = side, None

    def _follow(self, frame: Frame, filmed: Image, track: Track) -> FrameResult:
        image = np.ascontiguousarray(filmed[:, ::-1]) if track.side == "left" else filmed
        judge, facing = self.settings.judge, self.facing
        astray = track.misses >= judge.astray and not track.side_looks
        if track.lost or astray:
            recover(image, self._tracked_camera(track), track, judge, facing, self.rng)
        with self._timed("evidence"):
            predicted = track.predicted()
            evidence, view = self._see(image, track, predicted)
        with self._timed("method"):
            if track.method is track.searcher and frame.index % ASK_EVERY == 0:
                hypotheses = hypotheses_near(view, track.searcher, predicted)
                track.searcher.tell(hypotheses, predicted, track.segmenter.by_shape)
            estimate = track.method.follow(view, predicted, self.rng)
            workings = track.method.workings
        with self._timed("judge"):
            agreement = overlap(track.searcher.hand, estimate, view, judge.wrist_line_mm)
            if due := is_due(track, estimate, agreement, judge, facing):
                estimate, agreement = look_again(
                    view, track, estimate, agreement, judge, facing, self.rng
                )
            if due or track.unseen:
                self._ask_the_shape_cue(track, estimate, evidence)
            agreement = 0.0 if track.unseen else agreement
            status = status_of(agreement, track.misses, judge)
            if status is Status.TRACKED and frame.index % ASK_EVERY == 0:
                self._ask_what_is_shown(view, track, estimate)
        if track.is_other_hand:
            self._begin_anew(OTHER_SIDE[track.side])
        if self.track is None:
            return self.step(frame)
        track.accept(estimate, status)
        if status is Status.TRACKED:
            with self._timed("learn"):
                self._learn(image, track, evidence, view, agreement)
        self.last_evidence = evidence
        self.seen = Seen(frame.index, evidence, estimate, workings) if workings else None
        if status is Status.LOST:
            return FrameResult.unknown(frame.index, frame.time_s, side=track.side)
        # some of the doubt is in the curvature by now; with the root of it 90 % intervals hold
        return result_of(
            frame,
            replace(estimate, theta_std=np.sqrt(view.doubt) * estimate.theta_std),
            status,
            confidence(agreement, judge),
            track.side,
            track.shape,
            self.camera,
        )

    def _ask_the_shape_cue(self, track: Track, estimate: Estimate, evidence: Evidence) -> None:
        """Does it see the hand at all, and can colours still tell the hand without it?"""
        hand = drawn(track.searcher.hand, estimate, evidence.camera)
        shape = seen_by_shape(evidence.image)
        track.unseen = share_seen(shape, hand) < self.settings.judge.least_seen
        if not track.unseen and evidence.mask.any():
            track.segmenter.reconsider(evidence.image, evidence.mask, shape, evidence.window)

    def _ask_what_is_shown(self, view: View, track: Track, estimate: Estimate) -> None:
        """Find out that it is the other hand, seen from the other side or not, if it is."""
        asked = [test for test in (self.shown, self.thumb) if test is not None and not test.is_over]
        if not asked or abs(estimate.pose.R[2, 2]) < EDGE_ON:
            return
        told, now = shown_log_odds(view, track.searcher, estimate), facing_of(estimate)
        sign = 1 if now == "palm" else -1  # a right hand is followed, whichever it is
        for test, log_odds in ((self.shown, told.palm), (self.thumb, told.thumb_right)):
            if test in asked:
                test.watch(sign * log_odds)
        if not any(test.is_wrong for test in asked):
            return
        turned, swapped = (test is not None and test.lead < 0 for test in (self.shown, self.thumb))
        # the outline of another hand's palm is this one's back; with both it is this hand's back
        other = OTHER_SIDE[track.side]
        side = other if turned != swapped else OTHER_SIDE[other]
        self.found_out = (side, OTHER_WAY[self.facing] if turned else self.facing)  # at the start
        self.facing = OTHER_WAY[now] if turned else now
        self.shown = self.thumb = None
        self._begin_anew(side)

    def _see(self, image: Image, track: Track, predicted: Estimate) -> tuple[Evidence, View]:
        camera = self._tracked_camera(track)
        track.segmenter.relight(image)
        window = window_for(predicted.pose, track.shape, camera)
        seed = drawn(track.searcher.hand, predicted, camera.through(window))
        evidence = see(image, window, camera, track.segmenter, seed)
        doubt = doubtful(evidence.decided, self.settings.judge)
        return evidence, View.of(evidence, doubt=doubt)

    def _tracked_camera(self, track: Track) -> Camera:
        return self.camera.mirrored() if track.side == "left" else self.camera

    def _learn(
        self, image: Image, track: Track, evidence: Evidence, view: View, agreement: float
    ) -> None:
        """Colours, background, and the shape if it is still the default's."""
        if agreement > 0.88:
            mask = evidence.mask.astype(np.uint8)
            kernel = np.ones((5, 5), np.uint8)
            track.segmenter.learn(
                evidence.image, cv2.erode(mask, kernel) > 0, cv2.dilate(mask, kernel) == 0
            )
            track.segmenter.watch(image, evidence.mask, evidence.window)
        wanted = track.quality < self.settings.start.good_quality and self.given is None
        if wanted and self.calibrate is not None and len(self.timings_ms["learn"]) % 5 == 0:
            # an open palm that faces as it should tells the side, where that was a guess
            sure = (
                self.side != "auto" or track.quality > 0 or facing_of(track.estimate) != self.facing
            )
            found = recalibrated(
                evidence, self.calibrate, HandShape.default(), self.facing,
                self.settings.start, "right" if sure else None, track.quality,
            )  # fmt: skip
            if found is not None and found.side == "left":
                self._begin_anew(OTHER_SIDE[track.side])
            elif found is not None:
                track.shape, track.quality = found.shape, found.quality
                track.searcher = self._searcher(found.shape)
                track.method = self._method(found.shape, track.searcher)
                track.estimate = Estimate(found.pose, found.theta, track.estimate.theta_std)
                track.method.restart(track.estimate, sure=True)
