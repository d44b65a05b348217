"""What one frame can show of how it was worked out: the layers of the report.

A method leaves its :class:`Workings` after each frame and the tracker keeps them, with what it
saw, as :class:`Seen`: references only, so that a run without a report pays nothing. Whoever wants
pictures turns them into :class:`FrameLayers` (:func:`layers_of`), all in pixels of the frame **as
filmed**: a left hand is tracked in the mirror, and its layers are mirrored back here.

A cloud is named for what it is. The paper's filters have *particles*, weighted whole hands; the
default method has *samples*, one digit at a time with the rest of the hand held, each weighing
``exp(-E / 2)`` against the best of its digit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import Evidence
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import TIPS
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Surface
from handtrack.hand.visible import visible_shares
from handtrack.records import FrameResult, Pose, freeze_arrays

Array = NDArray[np.float64]
CloudKind = Literal["particles", "samples", ""]

#: Most members of a cloud that are shown: the heaviest, and others at equal steps.
MOST_SHOWN, HEAVIEST_SHOWN = 200, 60


@dataclass(frozen=True, eq=False)
class Cloud:
    """Hands that a method weighed in one frame.

    ``digit`` is the one that a sample is of, -1 where the whole hand is; the heaviest ``weight``
    (of its digit) is 1.
    """

    kind: CloudKind
    theta: Array  # (n, 20)
    weight: Array  # (n,)
    digit: NDArray[np.intp]  # (n,)
    pose: Pose  # that they were weighed at

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of_particles(cls, theta: Array, W: Array, pose: Pose) -> "Cloud":
        """Whole hands ``(n, 20)`` with weights ``(n,)``."""
        weight = W / max(float(W.max()), 1e-300)
        return cls("particles", theta, weight, np.full(len(W), -1), pose)

    @classmethod
    def of_sweep(cls, tried: Array, energies: Array, pose: Pose) -> "Cloud":
        """The candidates ``(5, n, 20)`` of a sweep over the digits with energies ``(5, n)``."""
        weight = np.exp(-0.5 * (energies - energies.min(axis=1, keepdims=True)))
        digit = np.repeat(np.arange(5), energies.shape[1])
        return cls("samples", tried.reshape(-1, tried.shape[-1]), weight.ravel(), digit, pose)


@dataclass(frozen=True, eq=False)
class Workings:
    """What a method leaves open to view after a frame.

    ``pairs`` gives the matches behind an estimate, ``(p, 4)`` in window pixels: where the image has
    the point, then where the model has it.
    """

    surface: Surface
    shape: HandShape
    space: ConfigurationSpace
    cloud: Cloud
    pairs: Callable[[Estimate], Array]
    log_likelihood: float = np.nan  # of the best particle


@dataclass(frozen=True, eq=False)
class Seen:
    """What a tracker saw in frame ``index`` and made of it, of the right hand that it tracks."""

    index: int
    evidence: Evidence
    estimate: Estimate
    workings: Workings


@dataclass(frozen=True, eq=False)
class FrameLayers:
    """The layers of one frame, in its pixels as filmed; what is not known has no rows, or is NaN.

    Patches come the farthest first; ``patch_seen`` is the share of each that nothing else hides.
    Of a cloud of particles every member has five fingertips, of one of samples the sampled
    digit's alone. ``cloud_X`` and ``X`` are the first two coordinates of the configuration space,
    and the line nearest to the estimate runs between the basis states ``line``.
    """

    contour: Array  # (m, 2)
    edges: Array  # (k, 3) x, y, strength 0 to 1
    pairs: Array  # (p, 4) the image's point, the model's
    patches: Array  # (P, V, 2)
    patch_digit: NDArray[np.intp]  # (P,) -1: the palm
    patch_seen: Array  # (P,) 0 to 1
    tips: Array  # (n, T, 2)
    cloud_X: Array  # (n, 2)
    cloud_weight: Array  # (n,)
    cloud_digit: NDArray[np.intp]  # (n,)
    cloud_kind: CloudKind
    cloud_size: int  # before it was thinned
    X: Array  # (2,)
    line: NDArray[np.intp]  # (2,) -1: unknown
    energy: float
    log_likelihood: float

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def none(cls) -> "FrameLayers":
        """Of a frame that nobody looked at."""
        points, ints = np.empty((0, 2)), np.empty(0, np.intp)
        return cls(
            contour=points, edges=np.empty((0, 3)), pairs=np.empty((0, 4)),
            patches=np.empty((0, 1, 2)), patch_digit=ints, patch_seen=np.empty(0),
            tips=np.empty((0, 1, 2)), cloud_X=points, cloud_weight=np.empty(0), cloud_digit=ints,
            cloud_kind="", cloud_size=0, X=np.full(2, np.nan), line=np.full(2, -1),
            energy=np.nan, log_likelihood=np.nan,
        )  # fmt: skip


def seen_by(tracker: object, index: int) -> Seen | None:
    """What a tracker saw in frame ``index``, if it is one that tells and did look at it."""
    seen = getattr(tracker, "seen", None)
    return seen if isinstance(seen, Seen) and seen.index == index else None


def layers_of(seen: Seen | None, result: FrameResult, camera: Camera) -> FrameLayers:
    """The layers of a frame; ``camera`` is that of the clip as filmed.

    Where the hand is lost there is no model to show, but what was seen and tried is.
    """
    if seen is None:
        return FrameLayers.none()
    left = result.side == "left"
    mirror = (camera.width_px - 1.0) if left else None
    tracked = camera.mirrored() if left else camera
    evidence, estimate, workings = seen.evidence, seen.estimate, seen.workings
    window, space = evidence.window, workings.space
    known = bool(np.isfinite(result.theta).all())
    empty = FrameLayers.none()
    patches, digit, share = empty.patches, empty.patch_digit, empty.patch_seen
    pairs, X, line = empty.pairs, empty.X, empty.line
    if known:
        patches, digit, share = _patches(workings.surface, estimate, tracked)
        pairs = workings.pairs(estimate)
        pairs = window.to_frame(pairs.reshape(-1, 2, 2)).reshape(-1, 4)
        at = space.to_X(estimate.theta)
        X, line = at[:2], space.nearest_line(at[None]).pair[0]
    cloud = workings.cloud
    rows = shown_rows(cloud.weight, cloud.digit)
    return FrameLayers(
        contour=_filmed(window.to_frame(evidence.contour), mirror),
        edges=np.column_stack(
            [
                _filmed(window.to_frame(evidence.edge_points), mirror),
                evidence.edge_point_strength,
            ]
        ),
        pairs=_filmed(pairs.reshape(-1, 2, 2), mirror).reshape(-1, 4),
        patches=_filmed(patches, mirror),
        patch_digit=digit,
        patch_seen=share,
        tips=_filmed(_tips(cloud, rows, workings.shape, tracked), mirror),
        cloud_X=space.to_X(cloud.theta[rows])[:, :2],
        cloud_weight=cloud.weight[rows],
        cloud_digit=cloud.digit[rows],
        cloud_kind=cloud.kind,
        cloud_size=len(cloud.weight),
        X=X,
        line=line,
        energy=estimate.energy,
        log_likelihood=workings.log_likelihood,
    )


def shown_rows(weight: Array, digit: NDArray[np.intp]) -> NDArray[np.intp]:
    """Which members of a cloud are shown: of each digit the heaviest, and others at equal steps.

    >>> shown_rows(np.ones(4), np.full(4, -1)).tolist()
    [0, 1, 2, 3]
    >>> len(shown_rows(np.arange(5000.0), np.full(5000, -1)))
    200
    """
    if len(weight) <= MOST_SHOWN:
        return np.arange(len(weight))
    groups = np.unique(digit)
    most, heaviest = MOST_SHOWN // len(groups), HEAVIEST_SHOWN // len(groups)
    kept = []
    for d in groups:
        own = np.flatnonzero(digit == d)
        order = own[np.argsort(-weight[own], kind="stable")]
        rest = np.sort(order[heaviest:])
        steps = np.linspace(0, len(rest) - 1, min(most - heaviest, len(rest))).round().astype(int)
        kept += [order[:heaviest], rest[steps]]
    return np.sort(np.concatenate(kept))


def _patches(
    surface: Surface, estimate: Estimate, camera: Camera
) -> tuple[Array, NDArray[np.intp], Array]:
    """Patches ``(P, V, 2)`` the farthest first, their digits and the share of each that shows."""
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    seen = surface.patches(estimate.theta[None], estimate.pose, K)
    order = np.argsort(-seen.depth_mm[0], kind="stable")
    corners, digit = seen.corners[0][order], np.asarray(seen.digit)[order]
    return corners, digit, visible_shares(corners, digit)


def _tips(cloud: Cloud, rows: NDArray[np.intp], shape: HandShape, camera: Camera) -> Array:
    """Fingertips ``(n, T, 2)`` of members of a cloud in the tracked image."""
    points = cloud.pose @ keypoints_mm(cloud.theta[rows], shape)[:, list(TIPS)]
    tips = camera.project(np.where(points[..., 2:] > 1.0, points, np.nan))
    if cloud.kind == "samples":
        tips = tips[np.arange(len(rows)), cloud.digit[rows]][:, None]
    return np.asarray(tips)


def _filmed(points_px: Array, mirror: float | None) -> Array:
    """Points ``(..., 2)`` of the tracked image in the frame as filmed."""
    if mirror is None:
        return points_px
    return np.stack([mirror - points_px[..., 0], points_px[..., 1]], axis=-1)
