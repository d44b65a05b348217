"""How well an estimate explains a frame: the overlap of silhouettes, and the status it earns."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.fingers.silhouette import SilhouetteBits, capsule_overlap
from handtrack.hand.capsules import CapsuleHand
from handtrack.records import Status
from handtrack.refine.view import View

#: How far along from wrist to middle knuckle the largest disc of a silhouette lies at most, and how
#: far beside, in lengths of the palm. (On rendered and real clips it is at 0.8 at most, and at 1.1
#: where a palm was on the forearm.)
DISC_AT_MOST, DISC_BESIDE = 0.9, 0.5
#: A palm so much foreshortened says nothing of that, nor does one that is so far from edge-on (the
#: cosine of its normal to the camera's axis).
LEAST_PALM_SEEN, NEAR_EDGE_ON = 0.6, 0.7
#: What the overlap of a hand is worth at most whose palm is on the forearm: it is not tracked.
ON_THE_ARM = 0.8


@dataclass(frozen=True)
class JudgeSettings:
    """When a hand counts as seen, and when as lost."""

    tracked_overlap: float = 0.84
    """Overlap of the silhouettes, without the forearm, from which a frame is tracked."""
    doubted_overlap: float = 0.91
    """Below this the hand is looked for anew now and then, in case it is otherwise."""
    strained: float = 1.25
    """And so where the energy is this many times what it was of late."""
    doubt_every: int = 6
    """Frames between two such looks."""
    young_every: int = 12
    """And between those at a hand that is not trusted yet, though it fits."""
    worse: float = 1.05
    """A look in vain puts off the next until the energy is this many times what it was then."""
    better_by: float = 0.02
    """Overlap by which what is found anew must beat what was followed."""
    cheaper_by: float = 10.0
    """Energy by which it must, where the overlaps are alike."""
    jump_cost: float = 10.0
    """And energy besides that a palm costs which is found elsewhere than it was followed: palms do
    not jump, fingers nearly do."""
    jump_deg: float = 15.0
    """Turn of the palm from which that is the whole cost; in proportion below."""
    facing_cost: float = 25.0
    """Energy by which a lost hand's unusual side must do better than its usual one."""
    less_seen: float = 0.8
    """What is found must leave no less than this share of the outline above its wrist, compared
    with what was followed: below the wrist nothing costs energy."""
    more_seen: float = 1.25
    """And is better without more ado where it leaves so much more."""
    turning_cost: float = 36.0
    """Energy by which the unusual side must do better still to begin a turn that was tracked."""
    returning_cost: float = 4.0
    """And the usual side to end one."""
    votes_to_turn: int = 2
    """Looks running that must see the usual side of the hand again before it is believed, and one
    more for the unusual: no hand turns over from one frame to the next."""
    vote_every: int = 3
    """Frames between such looks."""
    turned_every: int = 10
    """Frames between two looks while the hand shows its unusual side."""
    check_every: int = 60
    """Frames between two looks while all seems well: silhouettes can agree for a wrong hand."""
    lost_overlap: float = 0.35
    """Below this the hand is not where the model is."""
    astray: int = 4
    """Frames without a tracked one after which the hand is looked for in the whole frame."""
    patience: int = 15
    """Frames without a tracked one after which the hand is lost."""
    wrist_line_mm: float = 6.0
    """The evidence stops this far above the wrist."""
    min_seen: float = 0.5
    """Mean probability of hand, by the shape cue, without which a hand is not found again,"""
    least_seen: float = 0.3
    """and without which one in track is lost at the next look."""
    decided: float = 0.94
    """Decidedness of the evidence from which an outline is as sure as outlines are."""
    undecided: float = 14.0
    """Growth of its doubt with what is missing; both fitted, by what is stated, on the benchmark,
    seeds 3 to 5."""


def overlap(hand: CapsuleHand, estimate: Estimate, view: View, wrist_line_mm: float) -> float:
    """Intersection over union of model and silhouette, without forearm, inside the frame.

    Of a hand whose palm is on the forearm it is ``ON_THE_ARM`` at most.
    """
    return float(overlaps(hand, [estimate], view, SilhouetteBits.of(view), wrist_line_mm)[0])


def overlaps(
    hand: CapsuleHand,
    estimates: Sequence[Estimate],
    view: View,
    bits: SilhouetteBits,
    wrist_line_mm: float,
) -> NDArray[np.float64]:
    """The :func:`overlap` ``(n,)`` of each estimate; ``bits`` are the view's."""
    theta = np.array([e.theta for e in estimates])
    R = np.array([e.pose.R for e in estimates])
    t_mm = np.array([e.pose.t_mm for e in estimates])
    found = capsule_overlap(hand, theta, R, t_mm, view.intrinsics, bits, wrist_line_mm)
    on_arm = [lies_on_the_arm(hand, e, view) for e in estimates]
    return np.where(on_arm, np.minimum(found, ON_THE_ARM), found)


def lies_on_the_arm(hand: CapsuleHand, estimate: Estimate, view: View) -> bool:
    """Whether the fingers lie where the silhouette is widest, and palms are.

    A bare forearm is about as wide as a palm seen from its edge, and a fist will do for fingers.
    """
    if abs(estimate.pose.R[2, 2]) > NEAR_EDGE_ON or not view.discs:
        return False
    fx, fy, cx, cy = view.intrinsics
    length_mm = hand.shape.palm_length_mm
    ends = estimate.pose @ np.array([[0.0, 0.0, 0.0], [0.0, length_mm, 0.0]])
    z = np.maximum(ends[:, 2:], 1.0)
    wrist, knuckle = ends[:, :2] / z * (fx, fy) + (cx, cy)
    way, to_disc = knuckle - wrist, view.discs[0][0] - wrist
    length_px = float(np.linalg.norm(way))
    if length_px < LEAST_PALM_SEEN * fx * length_mm / z[0, 0]:
        return False
    along, beside = to_disc @ way, abs(to_disc[0] * way[1] - to_disc[1] * way[0])
    return bool(along > DISC_AT_MOST * length_px**2 and beside < DISC_BESIDE * length_px**2)


def drawn(hand: CapsuleHand, estimate: Estimate, camera: Camera) -> NDArray[np.bool_]:
    """The silhouette ``(h, w)`` of a hand as a camera sees it, roughly."""
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    circles = hand.circles_px(estimate.theta[None], estimate.pose.R, estimate.pose.t_mm, K)[0]
    mask = np.zeros((camera.height_px, camera.width_px), np.uint8)
    ends = circles[:, :2].round().astype(int).tolist()
    for a, b in hand.capsule_node.tolist():
        width = max(1, round(circles[a, 2] + circles[b, 2]))
        cv2.line(mask, ends[a], ends[b], 1, min(width, 255))
    return np.asarray(mask > 0)


def share_seen(log_odds: NDArray[np.float32], hand: NDArray[np.bool_]) -> float:
    """Mean probability of hand inside a silhouette ``(H, W)``; of a smaller picture's log odds."""
    size = log_odds.shape[1::-1]
    inside = cv2.resize(hand.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5
    return float((1 / (1 + np.exp(-log_odds[inside]))).mean()) if inside.any() else 0.0


def outline_seen(estimate: Estimate, view: View, wrist_line_mm: float) -> float:
    """Share of the silhouette's outline that lies above the estimate's wrist, so must be met."""
    weight = view.contour_weights(estimate.pose, wrist_line_mm)
    return float(np.mean(weight > 0)) if len(weight) else 0.0


def confidence(overlap: float, settings: JudgeSettings) -> float:
    """From 0 where the hand counts as lost to 1 where model and silhouette agree to 95 %."""
    span = 0.95 - settings.lost_overlap
    return float(np.clip((overlap - settings.lost_overlap) / span, 0.0, 1.0))


def doubtful(decided: float, settings: JudgeSettings) -> float:
    """Factor on the deviations of what is seen: an outline that is half a guess may be wrong.

    >>> doubtful(0.95, JudgeSettings()), round(doubtful(0.8, JudgeSettings()), 2)
    (1.0, 2.96)
    """
    return 1.0 + settings.undecided * max(settings.decided - decided, 0.0)


def status_of(overlap: float, misses: int, settings: JudgeSettings) -> Status:
    """Tracked if the silhouettes agree; else predicted until patience or the hand is gone."""
    if overlap >= settings.tracked_overlap:
        return Status.TRACKED
    if overlap < settings.lost_overlap or misses > settings.patience:
        return Status.LOST
    return Status.PREDICTED
