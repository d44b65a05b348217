"""Where the palm is: iterative closest points on its outline, with both tilts (Section 3).

Each round has five parts: **correspond** (nearest edge that faces the same way, one to one),
**reject** (beyond a gate that shrinks), **reduce** (robust weights; the extra points of Section
5, fingertips and finger roots, from the second round on), **solve**, and **stop** on rest. What
solves is a setting:

- ``orthographic``, the paper's: the weighted affine map of the pairs, then the quartic;
- ``perspective``: steps of Gauss-Newton with the known camera, from the pose before.

A plane has two tilts with nearly the same image. When the rounds are over the other one gets
rounds of its own; both are returned, the better first, and ``IcpResult.ambiguity`` says how
near the costs are: in a tie it is the start, the last frame's pose, that decides. The cost is the
mean of ``min(distance, gate)^2`` over the outline *and* the extra points under full perspective,
so that an unmatched sample costs as much as a far one, and so that the fingers vote on the tilt.

>>> from handtrack.hand.shape import HandShape
>>> from handtrack.palm.outline import palm_outline
>>> import numpy as np
>>> camera, (outline, normals) = Camera.assumed_for(640, 480), palm_outline(HandShape.default())
>>> truth = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 50.0, 450.0]))
>>> start = Pose(truth.R, truth.t_mm + [8.0, -6.0, 15.0])
>>> edges = camera.project(truth @ outline)
>>> result = icp(outline, normals, edges, normals[:, :2] * [1, -1], start, camera)
>>> result.status.value, bool(np.abs(result.poses[0].t_mm - truth.t_mm).max() < 1)
('converged', True)
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.correspondence import EdgePoints, correspond
from handtrack.palm.orthographic import other_tilt
from handtrack.palm.outline import Outline
from handtrack.palm.pairs import ExtraPoints, reduce_extra, reduce_matches
from handtrack.palm.perspective import PosePrior
from handtrack.palm.robust import Kind
from handtrack.palm.solve import solve_orthographic, solve_perspective
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IcpSettings:
    """The five parts' settings; lengths in mm at the palm, so that image size does not matter."""

    solver: Literal["perspective", "orthographic"] = "perspective"
    """The camera as it is, or the paper's scaled orthography."""
    rounds: int = 20
    """Most rounds for the first tilt."""
    gate_mm: float = 30.0
    """First distance beyond which pairs are rejected."""
    gate_min_mm: float = 5.0
    """Last such distance."""
    shrink: float = 0.75
    """What a round leaves of it."""
    angle_deg: float = 40.0
    """Pairs whose normals differ by more are rejected."""
    signed_normals: bool = False
    """Whether the edges' normals are known to point out of the hand."""
    robust: Kind = "tukey"
    """How far pairs weigh less."""
    floor_px: float = 0.7
    """Least scale of the residuals."""
    tangential: float = 0.03
    """What an error along the edge counts against one across it."""
    prior_rotation_deg: float = 25.0
    """How far the palm may turn from where it is expected, one standard deviation."""
    prior_shift_mm: float = 40.0
    """See ``prior_rotation_deg``."""
    min_matches: int = 8
    """Fewer matches of the outline determine nothing (but three extra points do)."""
    tie: float = 0.6
    """Tilts whose costs are more alike than this are a tie: the one nearer to the start leads."""
    still_deg: float = 0.02
    """A round that turns by less, and shifts by less than ``still_mm``, is rest."""
    still_mm: float = 0.05
    """See ``still_deg``."""

    def __post_init__(self) -> None:
        if self.rounds < 1 or not 0 < self.shrink <= 1 or self.min_matches < 3:
            raise InputError("icp: wanted rounds >= 1, 0 < shrink <= 1 and min_matches >= 3")
        if not 0 < self.gate_min_mm <= self.gate_mm:
            raise InputError("icp: wanted 0 < gate_min_mm <= gate_mm")


@dataclass(frozen=True, eq=False)
class IcpResult:
    """Both tilts, the better first: lower cost, or in a tie the one nearer to the start.

    There is one only where the other cannot be followed. ``costs`` are in px^2. Rounds, inliers,
    matches and convergence are those of ``poses[0]``; ``inliers`` counts the outline samples
    whose pair kept at least half its weight, ``samples`` all of them; ``information`` ``(6, 6)``
    is about its turn (rad) and shift (mm), zeros from the orthographic solver. If the status is
    not usable, the pose is the start's.
    """

    poses: tuple[Pose, ...]
    costs: tuple[float, ...]
    iterations: int
    inliers: int
    samples: int
    rms_px: float
    converged: bool
    information: Array  # (6, 6)
    matches: NDArray[np.intp]  # (p, 2) rows of the outline and of the edge points
    status: PalmStatus

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def ambiguity(self) -> float:
        """Lower cost over higher, 1 when the tilts cannot be told apart, 0 for a single one."""
        if len(self.costs) < 2:
            return 0.0
        return float((min(self.costs) + 1e-12) / (max(self.costs) + 1e-12))


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same from round to round."""

    outline: Outline
    edges: EdgePoints
    extra: ExtraPoints
    start: Pose
    camera: Camera
    settings: IcpSettings


@dataclass(frozen=True, eq=False)
class _Track:
    """Where one tilt's rounds ended; what failed keeps the pose that it began with."""

    pose: Pose
    status: PalmStatus
    rounds: int
    robust: Array  # (p,)
    residuals: Array  # (p,)
    information: Array  # (6, 6)
    matches: NDArray[np.intp]  # (p, 2)


def icp(
    outline_mm: ArrayLike,
    outline_normals: ArrayLike,
    edge_points_px: ArrayLike,
    edge_normals: ArrayLike,
    start: Pose,
    camera: Camera,
    extra: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    settings: IcpSettings | None = None,
    tangents: Array | None = None,
    expected: Pose | None = None,
) -> IcpResult:
    """Fit the palm's outline to edge points, from ``start``.

    Parameters
    ----------
    outline_mm, outline_normals : (n, 3)
        Points of the palm's outline and their unit outward normals, in the palm's plane.
    edge_points_px, edge_normals : (m, 2)
        Edge points of the image and their unit normals.
    start : Pose
        The last frame's pose, say.
    camera : Camera
    extra : (points_mm (k, 3), points_px (k, 2), weights (k,)), optional
        Pairs that are known, an outline sample's weight being 1; images that are not finite
        are left out.
    settings : IcpSettings, optional
    tangents, expected : optional
        The outline's, where it leaves the plane; what the first prior is about, if not ``start``.

    Raises
    ------
    InputError
        Shapes that do not go together.
    """
    problem = _Problem(
        Outline(np.asarray(outline_mm, float), np.asarray(outline_normals, float), tangents),
        EdgePoints(edge_points_px, edge_normals),
        ExtraPoints.of(extra),
        start,
        camera,
        settings or IcpSettings(),
    )
    if not _is_pose(start):
        return _result(problem, [_failed(start, PalmStatus.BAD_START, 0)])
    first = _rounds(problem, start, 0, expected or start)
    if not first.status.usable:
        return _result(problem, [first])
    centre = problem.outline.centre_mm
    perspective = problem.settings.solver == "perspective"
    other = other_tilt(first.pose, centre, line_of_sight=perspective)
    # its prior is about itself
    second = _rounds(problem, other, problem.settings.rounds // 2, other)
    return _result(problem, [first, second] if second.status.usable else [first])


def _rounds(problem: _Problem, begin: Pose, first_round: int, expected: Pose) -> _Track:
    """Correspond, reject, reduce, solve, until at rest."""
    s, outline, edges, camera = problem.settings, problem.outline, problem.edges, problem.camera
    prior = PosePrior(expected, np.radians(s.prior_rotation_deg), s.prior_shift_mm)
    track = _failed(begin, PalmStatus.TOO_FEW_POINTS, 0)
    pose = begin
    for done, k in enumerate(range(first_round, s.rounds), start=1):
        seen = outline.seen(pose, camera, s.solver == "orthographic")
        if seen is None:
            return _failed(begin, PalmStatus.BEHIND_CAMERA, done)
        gate_mm = max(s.gate_mm * s.shrink**k, s.gate_min_mm)
        gate_px = gate_mm * camera.fx_px / float((pose @ outline.centre_mm)[2])
        matches = correspond(*seen, edges, gate_px, np.radians(s.angle_deg), s.signed_normals)
        few = len(matches.model) < s.min_matches
        if few and len(problem.extra.weights) < 3:
            return _failed(begin, PalmStatus.TOO_FEW_POINTS, done)
        pairs, robust, residuals, scale = reduce_matches(
            outline, seen[0], edges, matches, s.robust, s.floor_px, s.tangential
        )
        if (k > 0 or few) and len(problem.extra.weights):
            pairs = pairs.joined(reduce_extra(problem.extra, pose, camera, scale))
        if s.solver == "orthographic":
            solved = solve_orthographic(pairs, pose, camera, prior)
        else:
            solved = solve_perspective(pairs, pose, camera, prior)
        if solved is None:
            return _failed(begin, PalmStatus.COLLINEAR, done)
        at_rest = gate_mm <= s.gate_min_mm and _rests(problem, pose, solved[0])
        status = PalmStatus.CONVERGED if at_rest else PalmStatus.ROUND_LIMIT
        rows = np.column_stack([matches.model, edges.original[matches.edge]])
        pose, information = solved
        track = _Track(pose, status, done, robust, residuals, information, rows)
        if at_rest:
            break
    return track


def _rests(problem: _Problem, before: Pose, after: Pose) -> bool:
    """Whether a round changed the pose by less than the settings' tolerances."""
    s, centre = problem.settings, problem.outline.centre_mm
    turned = float(np.linalg.norm(after.R - before.R)) / np.sqrt(2)  # of a small angle
    shifted = float(np.linalg.norm(after @ centre - before @ centre))
    return turned < np.radians(s.still_deg) and shifted < s.still_mm


def _cost(problem: _Problem, pose: Pose) -> float:
    """Mean of ``min(distance, gate)^2`` in px^2 over outline and extra points, in perspective."""
    s, outline, camera = problem.settings, problem.outline, problem.camera
    seen = outline.seen(pose, camera)
    if seen is None:
        return np.inf
    gate = s.gate_min_mm * camera.fx_px / float((pose @ outline.centre_mm)[2])
    angle = np.radians(s.angle_deg)
    matches = correspond(*seen, problem.edges, gate, angle, s.signed_normals)
    normals = problem.edges.normals[matches.edge]
    off = seen[0][matches.model] - problem.edges.points_px[matches.edge]
    across = np.sum(off * normals, axis=1)
    n = len(outline.points_mm)
    total = float(np.sum(across**2)) + gate**2 * (n - len(across))
    extra = np.minimum(problem.extra.offsets_px(pose, camera), gate) ** 2
    weights = problem.extra.weights
    return float((total + weights @ extra) / (n + weights.sum()))


def _result(problem: _Problem, tracks: list[_Track]) -> IcpResult:
    """The tracks, lower cost first; where they tie, the last frame decides."""
    costs = [_cost(problem, track.pose) for track in tracks]
    tie = min(costs) > problem.settings.tie * max(costs)
    turned = [float(rotation.angle_between(problem.start.R, track.pose.R)) for track in tracks]
    order = sorted(range(len(tracks)), key=turned.__getitem__ if tie else costs.__getitem__)
    best = tracks[order[0]]
    trusted = best.robust >= 0.5
    rms = float(np.sqrt(np.mean(best.residuals[trusted] ** 2))) if trusted.any() else np.nan
    return IcpResult(
        poses=tuple(tracks[i].pose for i in order),
        costs=tuple(costs[i] for i in order),
        iterations=best.rounds,
        inliers=int(trusted.sum()),
        samples=len(problem.outline.points_mm),
        rms_px=rms,
        converged=best.status is PalmStatus.CONVERGED,
        information=best.information,
        matches=best.matches,
        status=best.status,
    )


def _failed(pose: Pose, status: PalmStatus, rounds: int) -> _Track:
    none = np.empty(0)
    return _Track(pose, status, rounds, none, none, np.zeros((6, 6)), np.empty((0, 2), np.intp))


def _is_pose(pose: Pose) -> bool:
    """Whether ``pose`` is finite and a rotation."""
    finite = np.isfinite(pose.R).all() and np.isfinite(pose.t_mm).all()
    return bool(finite and np.abs(pose.R @ pose.R.T - np.eye(3)).max() < 1e-6)
