"""A hand in track: what is carried from frame to frame, and what is expected of the next."""

from collections import deque
from dataclasses import replace
from typing import Protocol

import numpy as np

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.layers import Workings
from handtrack.records import Pose, Status
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod
from handtrack.start import Start
from handtrack.steady import JUMP_DEG

#: Tracked frames in which a hand that was found by a search, at the start or again, is young.
YOUNG_FRAMES = 30
#: And so is one whose energy was this many times what was usual: a turn, a blur.
SHAKEN = 2.0
#: Looks in which a guess of the side must hold.
SIDE_LOOKS = 8
#: Frames over which an energy is usual, and how many of them it takes to say so.
USUAL_FRAMES, FEWEST_FRAMES = 60, 15


class Method(Protocol):
    """How a frame is worked out: the default's way, or the paper's."""

    workings: Workings | None

    def follow(self, view: View, predicted: Estimate, rng: np.random.Generator) -> Estimate:
        """The hand in this frame, from where it was expected."""
        ...

    def restart(self, estimate: Estimate, sure: bool = False) -> None:
        """Begin anew about an estimate that was found otherwise, and may be sure."""
        ...


class Track:
    """A hand in track: its shape and side, where it is, and how it moves."""

    def __init__(
        self, start: Start, searcher: RefinedMethod, method: Method, side_told: bool = True
    ) -> None:
        self.shape, self.side, self.segmenter = start.shape, start.side, start.segmenter
        self.searcher, self.method = searcher, method
        calibrated = start.quality > 0
        method.restart(start.estimate, sure=calibrated)
        self.estimate = start.estimate
        self.quality = start.quality  # of the open palm that the shape is from; 0 for none
        self.turn = np.zeros(3)  # rotation vector per frame
        self.shift_mm = np.zeros(3)
        self.misses = 0
        self.frames_astray = 0  # in which it was looked for in the whole frame, or should be
        self.doubts = 0  # frames since the last look
        self.in_vain = 0  # looks running that changed nothing
        self.excused = 0.0  # energy at the last of them
        #: Frames in which what was found by a search is not yet trusted.
        self.young = 0 if calibrated else YOUNG_FRAMES
        self.anchor = start.estimate  # what a look starts from: the last estimate that was trusted
        #: Looks still to come that may find that it is the other hand, where the side is a guess.
        self.side_looks = 0 if side_told or calibrated else SIDE_LOOKS
        self.is_other_hand = False
        self.votes = 0  # looks running that saw the other side of the hand
        self.voted_lost = False  # whether the first of them was at a fit that had failed
        self.lost = False
        self.unseen = False  # by the shape cue: a face, perhaps, where the hand has left
        self.fresh = True
        self.energies: deque[float] = deque(maxlen=USUAL_FRAMES)

    def predicted(self) -> Estimate:
        """Constant velocity of the palm, damped; the angles as they were."""
        pose = self.estimate.pose
        R = rotation.exp(0.5 * self.turn) @ pose.R
        return replace(self.estimate, pose=Pose(R, pose.t_mm + 0.7 * self.shift_mm))

    def strains(self, estimate: Estimate, factor: float) -> bool:
        """Whether the energy is above what is usual of late by ``factor``."""
        usual = np.median(self.energies) if len(self.energies) >= FEWEST_FRAMES else np.inf
        return bool(estimate.energy > factor * usual)

    def found_again(self, estimate: Estimate) -> None:
        """Go on from where a lost hand was found, without trusting it yet."""
        self.estimate, self.fresh, self.misses = estimate, True, 0
        self.votes, self.voted_lost, self.in_vain = 0, False, 0
        self.young = YOUNG_FRAMES
        self.method.restart(estimate)

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
        self.young = max(self.young - seen, 0)
        if self.strains(estimate, SHAKEN):
            self.young = YOUNG_FRAMES
        if not self.lost:
            self.estimate = estimate
        if seen and not self.young:
            self.anchor, self.frames_astray = estimate, 0
        if seen:
            self.energies.append(estimate.energy)
