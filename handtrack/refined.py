"""The default method: divide and conquer, then palm and fingers refined together.

One frame::

    move the prediction to where the silhouette is
    palm: refine the six numbers of its pose, fingers held          (few steps)
    all: refine                                                    -> candidate
    fingers: one sweep of samples a digit on the whole hand, then refine all -> candidate
    hand: all fingers to their nearest basis states, palm, then refine all   -> candidate
    palm: pitched about the knuckles, the fingers making up for it, then refine all -> candidate
    keep the candidate of lowest energy

Search before refinement is what keeps it out of local minima; refinement is what makes it exact.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.hand.capsules import CapsuleHand
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Capsules, Surface
from handtrack.layers import Cloud, Workings
from handtrack.palm.orthographic import other_tilt
from handtrack.parallel import both
from handtrack.proposer.network import Hypotheses
from handtrack.records import Pose
from handtrack.refine.digits import digit_lines, off_line_precision
from handtrack.refine.facing import Facing
from handtrack.refine.matches import contour_pairs
from handtrack.refine.pitch import pitched
from handtrack.refine.prior import Prior
from handtrack.refine.snap import snapped
from handtrack.refine.solve import Refined, Refiner, RefineSettings
from handtrack.refine.sweep import SweepSettings, sweep
from handtrack.refine.view import View
from handtrack.window import shifted_pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RefinedSettings:
    """Steps and priors of the default method."""

    palm_steps: int = 5
    """Refinement steps on the palm alone."""
    first_steps: int = 8
    """Steps on everything before the sweep."""
    last_steps: int = 6
    """Steps on everything after it."""
    snaps: int = 1
    """Whole-hand proposals at basis states."""
    snap_steps: int = 8
    """Steps on everything after such a proposal or the next."""
    pitches: int = 1
    """Proposals of a palm that pitches while the fingers make up for it."""
    pitch_std_deg: float = 12.0
    """By how much it does."""
    tilt_share: float = 0.2
    """Share of the frames, drawn at random, in which the palm's other tilt is tried."""
    tilts_apart_deg: float = 15.0
    """Angle between the two tilts from which that is worth it."""
    tilt_margin: float = 6.0
    """Energy by which the other tilt must be better."""
    angle_std_deg: float = 25.0
    """How far an angle moves from frame to frame."""
    turn_std_deg: float = 1.5
    """How far the palm turns from its prediction."""
    shift_std_mm: float = 20.0
    """How far it moves from its prediction, across the line of sight."""
    depth_std_mm: float = 5.0
    """And along it."""
    facing_std_deg: float = 8.0
    """How far the palm faces from where it has faced of late; 0 for no such pull."""
    facing_frames: int = 60
    """Frames that are of late."""
    between: float = 1.5
    """Energy of a finger half-way between extended and curled (twice the log of how much rarer
    recorded hands are there would be 3 to 4; half of it does not hurt fingers that stay there)."""
    widen: float = 1.0
    """Factor on the covariance of the configuration space off the digits' lines."""
    floor_deg: float = 6.0
    """Standard deviation added to it in every direction."""
    told: float = 0.25
    """Share of what the proposer says its angles are worth that is believed,"""
    told_by_shape: float = 1.0
    """and where colours cannot tell the hand from what is behind it."""
    told_share: float = 0.5
    """Share of the proposals of whole hands that are the proposer's, not basis states."""
    spread: float = 1.5
    """Factor on the stated standard deviations, fitted on the benchmark's `clean` and `turning`."""
    energy: RefineSettings = field(default_factory=RefineSettings)
    """The energy's weights."""
    sweep: SweepSettings = field(default_factory=SweepSettings)
    """The samples."""


class RefinedMethod:
    """Follow a hand of one shape by search and refinement."""

    def __init__(
        self, shape: HandShape, space: ConfigurationSpace, settings: RefinedSettings
    ) -> None:
        self.shape, self.space, self.settings = shape, space, settings
        self.hand = CapsuleHand(shape)
        self.surface: Surface = Capsules(shape)
        self.workings: Workings | None = None  # of the last search, open to view
        self.refiner = Refiner(self.hand, settings.energy)
        self.lines = digit_lines(space)
        self.precision = off_line_precision(space, self.lines, settings.widen, settings.floor_deg)
        self.facing = Facing(settings.facing_frames)
        self.told: tuple[Array, Array] | None = None  # angles and weights, from the picture

    def prior(self, predicted: Estimate, loose: float = 1.0) -> Prior:
        """Prior about a prediction; ``loose`` multiplies its standard deviations.

        A loose one is for a hand that may be anywhere: where it has faced says nothing then.
        """
        s = self.settings
        turn, shift = np.radians(s.turn_std_deg) * loose, s.shift_std_mm * loose
        depth = s.depth_std_mm * loose
        facing_std = np.radians(s.facing_std_deg) if loose == 1.0 else 0.0
        told, told_weight = predicted.theta, np.zeros(20)
        if loose == 1.0 and self.told is not None:
            told, told_weight = self.told
        return Prior(
            lines=self.lines,
            precision=self.precision,
            angle=predicted.theta,
            angle_weight=np.full(20, 1 / (np.radians(s.angle_std_deg) * loose) ** 2),
            pose=predicted.pose,
            pose_weight=np.array([1 / turn**2] * 3 + [1 / shift**2] * 2 + [1 / depth**2]),
            between=s.between,
            facing=self.facing.normal,
            facing_weight=self.facing.weight / facing_std**2 if facing_std > 0 else 0.0,
            told=told,
            told_weight=told_weight,
        )

    def tell(self, hypotheses: Hypotheses, predicted: Estimate, by_shape: bool) -> None:
        """How fingers bend by the proposer, for a palm as predicted; believed until told anew.

        Where it sees no such palm it says nothing of them. Where the outline is known ``by_shape``,
        so not well, that counts for more, and it also says where the palm faces.
        """
        self.told = self.facing.told = None
        if (near := hypotheses.near(predicted.pose.R)) is None:
            return
        theta, spread, normal = near
        share = self.settings.told_by_shape if by_shape else self.settings.told
        self.told = theta, share / spread**2
        self.facing.told = normal if by_shape else None

    def follow(self, view: View, predicted: Estimate, rng: np.random.Generator) -> Estimate:
        """The hand in this frame, from where it was expected."""
        s, start = self.settings, self.moved(view, predicted)
        found, self.workings = self._near(view, replace(predicted, pose=start), rng)
        if rng.random() < s.tilt_share:
            found = self.best_tilt(view, found, rng)
        self.facing.watch(found.pose.R[:, 2])
        return found

    def with_fingers(
        self, view: View, estimate: Estimate, theta: Array, rng: np.random.Generator
    ) -> Estimate:
        """The best hand about ``estimate``'s palm when the search begins with other fingers."""
        return self._near(view, replace(estimate, theta=theta), rng)[0]

    def _near(
        self, view: View, start: Estimate, rng: np.random.Generator, loose: float = 1.0
    ) -> tuple[Estimate, Workings]:
        """Palm first, then everything, with a prior about ``start``."""
        prior = self.prior(start, loose)
        palm = self.refiner(
            view, start.pose, start.theta, prior, self.settings.palm_steps, free="palm"
        )
        return self._search(view, palm.pose, palm.theta, prior, rng)

    def best_tilt(self, view: View, found: Estimate, rng: np.random.Generator) -> Estimate:
        """``found``, or the hand with the palm's other tilt where that explains the frame better.

        A plane has two tilts with nearly the same image (Section 3 of the paper); once the wrong
        one is followed, no small step leads back.
        """
        centre_mm = np.array([0.0, 0.55 * self.shape.palm_length_mm, 0.0])
        pose = other_tilt(found.pose, centre_mm)
        if rotation.angle_between(pose.R, found.pose.R) < np.radians(self.settings.tilts_apart_deg):
            return found
        other, workings = self._near(view, replace(found, pose=pose), rng, loose=4.0)
        if other.energy < self.energy(view, found) - self.settings.tilt_margin:
            self.workings = workings
            return other
        return found

    def restart(self, estimate: Estimate, sure: bool = False) -> None:
        """The palm faces as in ``estimate``, if that is sure; else its past may be forgotten."""
        self.facing.begin(estimate.pose.R[:, 2], known=sure)
        self.told = None

    def settle(self, view: View, seed: Estimate) -> Estimate:
        """Slide a seed of unknown quality into the nearest minimum."""
        prior = self.prior(seed, loose=4.0)
        palm = self.refiner(view, seed.pose, seed.theta, prior, 5, free="palm")
        return self.estimate(self.refiner(view, palm.pose, palm.theta, prior, 8), np.nan)

    def energy(self, view: View, estimate: Estimate) -> float:
        """Energy of an estimate as :meth:`search` would give it, with no pull from elsewhere."""
        prior = self.prior(estimate, loose=4.0)
        return self.refiner.weigh(view, estimate.pose, estimate.theta, prior)[1]

    def search(self, view: View, seed: Estimate, rng: np.random.Generator) -> Estimate:
        """Sweep and refine from a seed, with a loose prior about it."""
        return self._search(view, seed.pose, seed.theta, self.prior(seed, loose=4.0), rng)[0]

    def _search(
        self, view: View, pose: Pose, theta: Array, prior: Prior, rng: np.random.Generator
    ) -> tuple[Estimate, Workings]:
        """One finger at a time, and the whole hand at once, side by side; the best of them."""
        s = self.settings
        first = self.refiner(view, pose, theta, prior, s.first_steps)
        tried = np.empty((5, s.sweep.samples, 20))
        swept_rng, whole_rng = rng.spawn(2)

        def by_finger() -> tuple[Refined, Array]:
            swept, energies = sweep(
                self.refiner, view, first.pose, first.theta, prior, self.lines, s.sweep,
                swept_rng, tried,
            )  # fmt: skip
            return self.refiner(view, first.pose, swept, prior, s.last_steps), energies

        def by_hand() -> Refined:
            return self._proposed(view, first, prior, whole_rng)

        (second, energies), third = both(by_finger, by_hand)
        best = min(first, second, third, key=lambda r: r.energy)
        workings = Workings(
            self.surface, self.shape, self.space,
            Cloud.of_sweep(tried, energies, first.pose), partial(contour_pairs, self.refiner, view),
        )  # fmt: skip
        return self.estimate(best, effective_samples(energies)), workings

    def _proposed(
        self, view: View, best: Refined, prior: Prior, rng: np.random.Generator
    ) -> Refined:
        """The best of ``best`` and of whole hands at basis states or with a pitched palm."""
        s, refine = self.settings, self.refiner
        for _ in range(s.snaps):
            if self.told is not None and rng.random() < s.told_share:
                whole = np.clip(self.told[0], *LIMITS.T)
            else:
                whole = snapped(best.theta, self.lines, self.precision, rng)
            palm = refine(view, best.pose, whole, prior, s.palm_steps, free="palm")
            tried = refine(view, palm.pose, palm.theta, prior, s.snap_steps)
            best = min(best, tried, key=lambda r: r.energy)
        for _ in range(s.pitches):
            angle = rng.normal(0, np.radians(s.pitch_std_deg))
            pose, theta = pitched(best.pose, best.theta, self.shape, angle)
            tried = refine(view, pose, theta, prior, s.snap_steps)
            best = min(best, tried, key=lambda r: r.energy)
        return best

    def moved(self, view: View, predicted: Estimate) -> Pose:
        """The predicted pose, shifted to the silhouette where that lowers the energy."""
        prior = self.prior(predicted)
        candidates = [predicted.pose]
        candidates += [
            shifted_pose(predicted.pose, shift, view.intrinsics)
            for shift in self.shifts(view, predicted)
        ]
        return min(
            candidates,
            key=lambda pose: self.refiner.weigh(view, pose, predicted.theta, prior)[0],
        )

    def shifts(self, view: View, predicted: Estimate) -> list[Array]:
        """Image shifts from the model's middle to the silhouette's, whole and half."""
        circles = self.hand.circles_px(
            predicted.theta[None], predicted.pose.R, predicted.pose.t_mm, view.intrinsics
        )[0]
        weight = view.contour_weights(predicted.pose, self.settings.energy.wrist_line_mm) > 0
        if weight.sum() < 10:
            return []
        contour = view.contour[weight]
        low, high = (
            (circles[:, :2] - circles[:, 2:3]).min(axis=0),
            (circles[:, :2] + circles[:, 2:3]).max(axis=0),
        )
        top = contour.min(axis=0) - low, contour.max(axis=0) - high
        whole = 0.5 * (top[0] + top[1])
        return [whole, 0.5 * whole, top[0], top[1]]

    def estimate(self, refined: Refined, ess: float) -> Estimate:
        """An :class:`Estimate` with the spread that the curvature of the energy gives."""
        covariance = np.linalg.inv(refined.information)  # the prior makes it positive definite
        std = np.sqrt(np.maximum(np.diag(covariance)[6:], 1e-8)) * self.settings.spread
        return Estimate(refined.pose, refined.theta, std, ess, refined.energy)


def effective_samples(energies: Array) -> float:
    """Mean over digits of ``1 / sum w^2`` for weights ``exp(-E / 2)``, of energies ``(5, n)``."""
    w = np.exp(-0.5 * (energies - energies.min(axis=1, keepdims=True)))
    w /= w.sum(axis=1, keepdims=True)
    return float(np.mean(1.0 / np.sum(w**2, axis=1)))
