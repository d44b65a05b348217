"""The loop: see, palm and fingers, report; and what happens when there is no hand.

One frame with a hand in track::

    image    the frame, flipped if the hand is a left one
    view     evidence in the window where the hand should be
    estimate the method's palm <-> fingers alternation from the prediction
    status   does the model explain the silhouette? else look for the hand anew

The tracked model is always a right hand; :mod:`handtrack.report` turns it into the hand as filmed.
"""

import time
from collections import defaultdict, deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import Evidence, see, window_around
from handtrack.evidence.silhouette import Segmenter
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.space import default as default_space
from handtrack.judge import JudgeSettings, confidence, overlap, status_of
from handtrack.layers import Seen, Workings
from handtrack.paper import PaperMethod, PaperSettings
from handtrack.records import Frame, FrameResult, Pose, Status
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings
from handtrack.report import result_of
from handtrack.seeds import facing_of, find_hand
from handtrack.start import (
    Calibrate,
    Start,
    StartSettings,
    calibrated_start,
    recalibrated,
    searched_start,
)
from handtrack.window import window_for

Image = NDArray[np.uint8]

#: A palm that turns more than this in a frame was found otherwise: that is no motion.
JUMP_DEG = 25.0


@dataclass(frozen=True)
class TrackerSettings:
    """What the tracker is told."""

    method: Literal["refined", "paper", "condensation", "random"] = "refined"
    """How a frame is worked out."""
    side: Literal["auto", "right", "left"] = "auto"
    """Which hand it is; auto: told by the thumb."""
    facing: Literal["palm", "back"] = "palm"
    """Which way the hand faces at the start."""
    particles: int | None = None
    """Particles of the filters; by default what the paper gives each."""
    seed: int = 0
    """Seed of all randomness."""
    start: StartSettings = field(default_factory=StartSettings)
    judge: JudgeSettings = field(default_factory=JudgeSettings)
    refined: RefinedSettings = field(default_factory=RefinedSettings)
    paper: PaperSettings = field(default_factory=PaperSettings)


class Method(Protocol):
    """How a frame is worked out: the default's way, or the paper's."""

    workings: Workings | None

    def follow(self, view: View, predicted: Estimate, rng: np.random.Generator) -> Estimate:
        """The hand in this frame, from where it was expected."""
        ...

    def restart(self, estimate: Estimate) -> None:
        """Begin anew about an estimate that was found otherwise."""
        ...


class Track:
    """A hand in track: its shape and side, where it is, and how it moves."""

    def __init__(self, start: Start, searcher: RefinedMethod, method: Method) -> None:
        self.shape, self.side, self.segmenter = start.shape, start.side, start.segmenter
        self.searcher, self.method = searcher, method
        method.restart(start.estimate)
        self.estimate = start.estimate
        self.calibrated = start.calibrated
        self.turn = np.zeros(3)  # rotation vector per frame
        self.shift_mm = np.zeros(3)
        self.misses = 0
        self.doubts = 0
        self.votes = 0  # looks running that saw the other side of the hand
        self.lost = False
        self.fresh = True
        self.energies: deque[float] = deque(maxlen=60)  # of the last tracked frames

    def predicted(self) -> Estimate:
        """Constant velocity of the palm, damped; the angles as they were."""
        pose = self.estimate.pose
        R = rotation.exp(0.5 * self.turn) @ pose.R
        return replace(self.estimate, pose=Pose(R, pose.t_mm + 0.7 * self.shift_mm))

    def strains(self, estimate: Estimate, factor: float) -> bool:
        """Whether the energy is above what is usual of late by ``factor``."""
        usual = np.median(self.energies) if len(self.energies) >= 15 else np.inf
        return bool(estimate.energy > factor * usual)

    def accept(self, estimate: Estimate, status: Status) -> None:
        """Take an estimate over, with the motion it implies."""
        before, pose = self.estimate.pose, estimate.pose
        seen = status is Status.TRACKED
        self.misses = 0 if seen else self.misses + 1
        self.lost = status is Status.LOST
        jumped = rotation.angle_between(pose.R, before.R) > np.radians(JUMP_DEG)
        if seen and not self.fresh and not jumped:
            self.turn = rotation.log(pose.R @ before.R.T)
            self.shift_mm = pose.t_mm - before.t_mm
        else:
            self.turn, self.shift_mm = np.zeros(3), np.zeros(3)
        self.fresh = not seen
        if not self.lost:
            self.estimate = estimate
        if seen:
            self.energies.append(estimate.energy)


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
        self.waited = 0
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
        if self.calibrate is not None:
            start = calibrated_start(
                image,
                self.camera,
                self.calibrate,
                default,
                s.side,
                s.facing,
                s.start,
                fit_shape=self.given is None,
            )
        if start is None and self.waited % 5 == 0:
            start = searched_start(
                image, self.camera, self._searcher, default, s.side, s.facing, self.rng, s.start
            )
        self.waited += 1
        if start is not None:
            searcher = self._searcher(start.shape)
            self.track = Track(start, searcher, self._method(start.shape, searcher))

    def _follow(self, frame: Frame, filmed: Image, track: Track) -> FrameResult:
        image = np.ascontiguousarray(filmed[:, ::-1]) if track.side == "left" else filmed
        if track.lost:
            self._recover(image, track)
        with self._timed("evidence"):
            predicted = track.predicted()
            evidence, view = self._see(image, track, predicted)
        with self._timed("method"):
            estimate = track.method.follow(view, predicted, self.rng)
            workings = track.method.workings
        with self._timed("judge"):
            line_mm = self.settings.judge.wrist_line_mm
            agreement = overlap(track.searcher.hand, estimate, view, line_mm)
            if self._doubts(track, estimate, agreement):
                estimate, agreement = self._look_again(view, track, estimate, agreement)
            status = status_of(agreement, track.misses, self.settings.judge)
        track.accept(estimate, status)
        if status is Status.TRACKED:
            with self._timed("learn"):
                self._learn(image, track, evidence, view, agreement)
        self.last_evidence = evidence
        self.seen = Seen(frame.index, evidence, estimate, workings) if workings else None
        if status is Status.LOST:
            return FrameResult.unknown(frame.index, frame.time_s, side=track.side)
        return result_of(
            frame,
            estimate,
            status,
            confidence(agreement, self.settings.judge),
            track.side,
            track.shape,
            self.camera,
        )

    def _see(self, image: Image, track: Track, predicted: Estimate) -> tuple[Evidence, View]:
        camera = self._tracked_camera(track)
        window = window_for(predicted.pose, track.shape, camera)
        seed = model_mask(track.searcher, predicted, camera.through(window))
        evidence = see(image, window, camera, track.segmenter, seed)
        return evidence, View.of(evidence)

    def _tracked_camera(self, track: Track) -> Camera:
        return self.camera.mirrored() if track.side == "left" else self.camera

    def _look_again(
        self, view: View, track: Track, estimate: Estimate, agreement: float
    ) -> tuple[Estimate, float]:
        """A search with no idea of the pose; what it finds must beat what was followed."""
        judge, searcher = self.settings.judge, track.searcher
        # a hand that is well in track faces as it did; else it faces as hands usually do
        failed = agreement < judge.tracked_overlap
        usual = self.settings.facing if failed else facing_of(estimate)
        away = usual == self.settings.facing  # turning would show the side that is rarely shown
        cost = judge.facing_cost if failed else judge.turning_cost * (3.0 if away else 1.0)
        found = find_hand(
            view, searcher, ("palm", "back"), self.rng,
            known=track.estimate, usual=usual, facing_cost=cost,
        )  # fmt: skip
        if found is None:
            return estimate, agreement
        turns = not failed and facing_of(found[0]) != usual
        better = not turns and found[1] > agreement + judge.better_by
        as_good = found[1] > agreement - judge.better_by
        margin = judge.cheaper_by + cost * turns
        cheaper = found[0].energy < searcher.energy(view, estimate) - margin
        if not better and not (as_good and cheaper):
            track.votes = 0
            return estimate, agreement
        if facing_of(found[0]) != facing_of(estimate) and track.votes + 1 < judge.votes_to_turn:
            track.votes += 1
            track.doubts = judge.doubt_every - judge.vote_every
            return estimate, agreement
        track.fresh, track.votes = True, 0
        track.method.restart(found[0])
        return found

    def _doubts(self, track: Track, estimate: Estimate, agreement: float) -> bool:
        """Whether to look anew: often while the fit is poor, now and then in any case."""
        judge = self.settings.judge
        poor = agreement < judge.doubted_overlap or track.strains(estimate, judge.strained)
        turned = facing_of(track.estimate) != self.settings.facing
        track.doubts += 1
        every = judge.turned_every if turned else judge.check_every
        every = judge.doubt_every if poor or track.votes else every
        if track.doubts < every:
            return False
        track.doubts = 0
        return True

    def _recover(self, image: Image, track: Track) -> None:
        """Look for a lost hand in the whole frame."""
        if track.misses % 3 != 0:
            track.misses += 1
            return
        camera = self._tracked_camera(track)
        segmenter = track.segmenter
        anything = segmenter.find(image) or Segmenter.bootstrap(image, segmenter.background)
        for candidate in anything[:2]:
            evidence = see(image, window_around(candidate.mask), camera, track.segmenter)
            found = find_hand(
                View.of(evidence), track.searcher, ("palm", "back"), self.rng,
                known=track.estimate, usual=self.settings.facing,
                facing_cost=self.settings.judge.facing_cost,
            )  # fmt: skip
            if found is not None and found[1] > self.settings.judge.tracked_overlap:
                track.estimate, track.fresh, track.misses = found[0], True, 0
                track.method.restart(found[0])
                return

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
        wanted = not track.calibrated and self.given is None and self.calibrate is not None
        if wanted and self.calibrate is not None and len(self.timings_ms["learn"]) % 5 == 0:
            found = recalibrated(
                evidence, self.calibrate, HandShape.default(), self.settings.facing,
                self.settings.start,
            )  # fmt: skip
            if found is not None:
                track.shape, track.calibrated = found.shape, True
                track.searcher = self._searcher(found.shape)
                track.method = self._method(found.shape, track.searcher)
                track.estimate = Estimate(found.pose, found.theta, track.estimate.theta_std)
                track.method.restart(track.estimate)


def model_mask(method: RefinedMethod, estimate: Estimate, camera: Camera) -> NDArray[np.bool_]:
    """The predicted silhouette ``(h, w)`` in a window."""
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    circles = method.hand.circles_px(estimate.theta[None], estimate.pose.R, estimate.pose.t_mm, K)[
        0
    ]
    mask = np.zeros((camera.height_px, camera.width_px), np.uint8)
    for a, b in method.hand.capsule_node:
        ends = circles[[a, b], :2].round().astype(int)
        width = max(1, round(float(circles[a, 2] + circles[b, 2])))
        cv2.line(mask, ends[0].tolist(), ends[1].tolist(), 1, min(width, 255))
    return np.asarray(mask > 0)
