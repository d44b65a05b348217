"""The paper's method: palm by ICP, fingers by particles, in turn (Lin, Wu, Huang 2002, Section 5).

One frame, from the prediction::

    palm     orthographic ICP of the cardboard palm's outline on the edges, wrist and finger
             roots held weakly where they were; both tilts
    fingers  100 particles along the lines between basis states, weighed by edges and silhouette,
             which are let in in layers
    palm     again, with the fingertips as extra points and the fingers' sides as outline, and
             now with the known camera
    ...      until both rest, or ``rounds`` are over

The fingers choose between the tilts: each has its palm scored with them, less what it would have
turned. Two sides of a palm seen nearly from the front say next to nothing of its tilt, so every
fit of the palm is held near the prediction: that, and the camera from the second round on, is
where this departs from the paper. ``condensation`` and
``random`` take the particles' place with the paper's two other schemes. What a clip begins with,
and what is done about a lost hand, is as in :class:`~handtrack.refined.RefinedMethod`.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.fingers.baselines import Condensation, RandomSearch
from handtrack.fingers.densities import Gaussians
from handtrack.fingers.dynamics import Dynamics
from handtrack.fingers.filter import Filter, FilterSettings, ParticleFilter, Posterior
from handtrack.fingers.likelihood import FingerLikelihood, LikelihoodSettings
from handtrack.fingers.sides import visible_sides
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import TIPS
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Cardboard
from handtrack.layers import Cloud, Workings
from handtrack.palm.icp import IcpSettings, icp
from handtrack.palm.outline import palm_outline
from handtrack.records import Pose
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings

Array = NDArray[np.float64]
Scheme = Literal["paper", "condensation", "random"]
#: Samples of each scheme in the paper's comparison.
PUBLISHED: dict[str, int] = {"paper": 100, "condensation": 3000, "random": 5000}
#: Layers in which our particles let the likelihood in.
LAYERS = 6

#: Spread of the particles about an estimate that was found otherwise, as a share of the space's.
START_SHARE = 0.3


def _near(solver: Literal["perspective", "orthographic"], gate_mm: float) -> IcpSettings:
    """A fit of the palm that is held near the prediction: a palm moves so far in a frame."""
    return IcpSettings(solver, gate_mm=gate_mm, prior_rotation_deg=3.0, prior_shift_mm=10.0)


@dataclass(frozen=True)
class PaperSettings:
    """The paper's method."""

    rounds: int = 3
    """Most rounds of palm and fingers."""
    fingertips: bool = True
    """Fingertips go back to the palm from the second round on."""
    tip_weight: float = 2.0
    """Weight of a fingertip; a sample of the outline has 1."""
    root_weight: float = 5.0
    """Weight of the wrist and of each finger root where the last frame has them."""
    tip_reach_px: float = 10.0
    """How far from a predicted fingertip its image may be, in pixels of the window."""
    bones: int = 3
    """Bones of each finger, from its root, whose sides go back to the palm; 0 for none."""
    turn_std_deg: float = 4.0
    """How far the palm turns from its prediction when the fingers choose between the tilts."""
    still_deg: float = 0.3
    """Palm and fingers rest when they turn by less."""
    icp: IcpSettings = field(default_factory=lambda: _near("orthographic", 30.0))
    """The palm's fit in the first round, the paper's."""
    again: IcpSettings = field(default_factory=lambda: _near("perspective", 10.0))
    """And from the second round on, near what was found: refined with the known camera."""
    likelihood: LikelihoodSettings = field(default_factory=LikelihoodSettings)
    """The fingers' likelihood."""


class PaperMethod(RefinedMethod):
    """Follow a hand of one shape as the paper does."""

    def __init__(
        self,
        shape: HandShape,
        space: ConfigurationSpace,
        settings: RefinedSettings,
        scheme: Scheme = "paper",
        particles: int | None = None,
        paper: PaperSettings | None = None,
    ) -> None:
        super().__init__(shape, space, settings)
        self.paper = paper or PaperSettings()
        self.surface = self.cardboard = Cardboard(shape)
        self.filter = make_filter(scheme, particles or PUBLISHED[scheme], space)
        self.takes_best = scheme == "random"
        self.matched = np.empty((0, 4))  # the last palm's pairs: image, outline

    def restart(self, estimate: Estimate, sure: bool = False) -> None:
        """Begin anew about an estimate that was found otherwise; the particles are never sure."""
        super().restart(estimate, sure)
        about = self.space.to_X(estimate.theta)[None]
        spread = START_SHARE * np.sqrt(self.space.variance)
        self.filter.restart(Gaussians(np.ones(1), about, spread))

    def follow(self, view: View, predicted: Estimate, rng: np.random.Generator) -> Estimate:
        """The hand in this frame, from where it was expected."""
        start, theta = self.moved(view, predicted), predicted.theta
        pose = start
        for k in range(self.paper.rounds):
            before = pose, theta
            with_tips = k > 0 and self.paper.fingertips
            tilts = self._palm(view, start, pose, theta, with_tips)
            pose, posterior = self._fingers(view, start, tilts, theta, rng, again=k > 0)
            X = posterior.map_X if self.takes_best else posterior.mean
            theta = np.asarray(self.space.to_angles(X))
            if k > 0 and self._rests(*before, pose, theta):
                break
        self.workings = self._workings(posterior, pose)
        return Estimate(pose, theta, self._spread(posterior), posterior.ess)

    def _palm(
        self, view: View, start: Pose, pose: Pose, theta: Array, with_tips: bool
    ) -> tuple[Pose, ...]:
        """Both tilts of the palm on the edges of the view."""
        camera = _camera_of(view)
        points = np.concatenate([view.contour, view.inner[:, :2]])
        normals = np.concatenate([view.normal, view.inner[:, 2:4]])
        above = view.above_wrist(points, pose, self.settings.energy.wrist_line_mm)
        points_mm, across, along = self._outline(view, pose, theta, with_sides=with_tips)
        extra = self._roots(pose, camera)
        if with_tips:
            tips = self._tips(view, pose, theta, camera)
            known_mm, images, weights = (np.concatenate(p) for p in zip(extra, tips, strict=True))
            extra = known_mm, images, weights
        settings = self.paper.again if with_tips else self.paper.icp
        found = icp(
            points_mm, across, points[above], normals[above], pose, camera, extra, settings,
            along, expected=start,
        )  # fmt: skip
        model, edge = found.matches.T
        on_model = camera.project(found.poses[0] @ points_mm[model])
        self.matched = np.column_stack([points[above][edge], on_model])
        return found.poses if found.status.usable else (pose,)

    def _outline(
        self, view: View, pose: Pose, theta: Array, with_sides: bool
    ) -> tuple[Array, Array, Array]:
        """Points of the palm's outline, and of the fingers' sides, with normals and tangents."""
        points, across = palm_outline(self.shape, theta)
        own = points, across, np.cross([0.0, 0.0, 1.0], across)
        if not with_sides or self.paper.bones == 0:
            return own
        sides = visible_sides(self.cardboard, theta, pose, view.intrinsics, self.paper.bones)
        points, across, along = (np.concatenate(both) for both in zip(own, sides, strict=True))
        return points, across, along

    def _fingers(
        self,
        view: View,
        start: Pose,
        tilts: tuple[Pose, ...],
        theta: Array,
        rng: np.random.Generator,
        again: bool,
    ) -> tuple[Pose, Posterior]:
        """The tilt that the fingers of the last round speak for, and their posterior under it."""
        terms = [
            FingerLikelihood(self.surface, view, tilt, self.paper.likelihood) for tilt in tilts
        ]
        turns = np.array([rotation.angle_between(start.R, tilt.R) for tilt in tilts])
        prior = -0.5 * (turns / np.radians(self.paper.turn_std_deg)) ** 2
        best = int(np.argmax(prior + [term(theta[None])[0] for term in terms]))
        posterior = self.filter.step(
            rng, lambda X: terms[best](self.space.to_angles(X)), again=again
        )
        return tilts[best], posterior

    def _roots(self, pose: Pose, camera: Camera) -> tuple[Array, Array, Array]:
        """The wrist and the finger roots where they were last: the last frame's weak vote.

        Two sides of a palm, nearly parallel, leave its length and its place along them open.
        """
        points = np.vstack([np.zeros(3), self.shape.base_mm[1:]])
        weights = np.full(len(points), self.paper.root_weight)
        return points, np.asarray(camera.project(pose @ points)), weights

    def _tips(
        self, view: View, pose: Pose, theta: Array, camera: Camera
    ) -> tuple[Array, Array, Array]:
        """Fingertips in the palm's frame, the contour points they are seen at, and weights."""
        points = keypoints_mm(theta, self.shape)
        tips, before = points[list(TIPS)], points[[t - 1 for t in TIPS]]
        seen = camera.project(pose @ tips)
        along = seen - camera.project(pose @ before)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        images = np.full((5, 2), np.nan)
        for d in range(5):
            offset = view.contour - seen[d]
            ahead = view.normal @ along[d] > 0.8
            near = np.linalg.norm(offset, axis=1)
            near[~ahead] = np.inf
            if len(near) and near.min() < self.paper.tip_reach_px:
                images[d] = view.contour[np.argmin(near)]
        return tips, images, np.full(5, self.paper.tip_weight)

    def _rests(self, pose0: Pose, theta0: Array, pose: Pose, theta: Array) -> bool:
        turn = float(rotation.angle_between(pose0.R, pose.R))
        bend = float(np.abs(theta - theta0).mean())
        return max(turn, bend) < np.radians(self.paper.still_deg)

    def _workings(self, posterior: Posterior, pose: Pose) -> Workings:
        matched, best = self.matched, float(posterior.logG.max())
        cloud = Cloud.of_particles(self.space.to_angles(posterior.X), posterior.W, pose)
        return Workings(self.surface, self.shape, self.space, cloud, lambda estimate: matched, best)

    def _spread(self, posterior: Posterior) -> Array:
        """Standard deviations of the angles: the particles', and what the space leaves out."""
        C = self.space.components
        left_out = np.diag(self.space.covariance) - np.diag(C.T @ np.diag(self.space.variance) @ C)
        inside = np.diag(C.T @ posterior.cov @ C)
        return np.sqrt(np.maximum(inside + left_out, np.radians(1.0) ** 2))


def make_filter(scheme: str, particles: int, space: ConfigurationSpace) -> Filter:
    """The scheme with so many samples; the walks of all are the prior's own."""
    dynamics = Dynamics.about(space)
    if scheme == "paper":
        return ParticleFilter(dynamics, FilterSettings(particles, ess_share=0.25, layers=LAYERS))
    if scheme == "condensation":
        return Condensation(dynamics.M0(), dynamics.sigma, particles)
    spread = 1.5 * np.sqrt(space.variance)
    return RandomSearch(Gaussians(np.ones(1), np.zeros((1, len(spread))), spread), particles)


def _camera_of(view: View) -> Camera:
    fx, fy, cx, cy = view.intrinsics.tolist()
    height, width = view.sdf.shape
    return Camera(fx, fy, cx, cy, width, height)
