"""Find the hand in a silhouette with no idea of its pose: many seeds, a quick score, refinement.

Seeds place the palm where the silhouette holds the largest discs, at the depth that fits their
size, in every direction in the image, tilted a little or not, with the fingers at a basis
configuration or between two of them. Overlap of the silhouettes ranks thousands of them in tens of
milliseconds; the best and most diverse are refined, and the best overlap wins. Seeds of the
proposer's network join them.
"""

from dataclasses import dataclass
from functools import partial
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.fingers.silhouette import SilhouetteBits, capsule_overlap
from handtrack.hand.skeleton import LIMITS
from handtrack.hand.space import ConfigurationSpace
from handtrack.judge import outline_seen, overlaps
from handtrack.parallel import each
from handtrack.proposer.network import Hypotheses
from handtrack.records import Pose, Shown
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod

Array = NDArray[np.float64]
#: Rotation of a palm that faces the camera, fingers up; and of the back of a hand.
FACING = {"palm": np.diag([1.0, -1.0, -1.0]), "back": np.diag([-1.0, -1.0, 1.0])}

#: Parts in which the seeds are scored side by side.
SCORED_IN = 4

#: Cosine by which a hand may be past edge-on and still count as facing as it should.
PAST_EDGE_ON = 0.25
#: A hand of known depth is not looked for at more than this ratio from it.
MAX_DEPTH_RATIO = 1.5


@dataclass(frozen=True)
class SeedSettings:
    """How many seeds, and how many of them survive each round."""

    seeds: int = 800
    """Seeds that are scored by overlap."""
    kept: int = 10
    """Seeds that are refined a little."""
    finalists: int = 4
    """Of those, how many are swept and refined to the end."""
    searches: int = 2
    """How often those are swept and refined."""
    tilt_std_deg: float = 18.0
    """Spread of the palm's tilt."""
    overlap_margin: float = 0.04
    """Of finalists whose overlaps differ by less, the lowest energy wins: edges inside a fist."""
    outline_share: float = 0.8
    """Of the finalists, those count that leave this share of the outline above the wrist, compared
    with the one that leaves most: below the wrist nothing costs energy."""
    depth_std: float = 0.12
    """Spread of the depth, relative."""
    proposed: float = 0.5
    """Share of the seeds that the network proposes."""
    proposed_kept: int = 6
    """Of those that are refined a little, at least so many are proposed."""
    told: float = 0.5
    """Energy per unit of the network's log density, where finalists are compared."""


def find_hand(
    view: View,
    method: RefinedMethod,
    facings: tuple[str, ...],
    rng: np.random.Generator,
    settings: SeedSettings | None = None,
    known: Estimate | None = None,
    usual: str = "palm",
    facing_cost: float = 0.0,
    hypotheses: Hypotheses | None = None,
) -> tuple[Estimate, float] | None:
    """The best estimate in a silhouette, and its overlap; None where none is found.

    ``facings`` are the sides of the hand that may be shown. ``known`` (an earlier estimate) joins
    the configurations, and the depth stays near its own. A fist's silhouette is nearly the same
    from both sides: the hand faces the ``usual`` way unless the energy of the other is lower by
    ``facing_cost``. With ``hypotheses`` (:mod:`handtrack.proposals`) some of the seeds are drawn
    from them, and what they say of the finalists counts.
    """
    settings = settings or SeedSettings()
    discs = view.discs
    if not discs:
        return None
    bits = SilhouetteBits.of(view)
    line_mm = method.settings.energy.wrist_line_mm
    theta, R, t = draw_seeds(view, method, discs, facings, rng, settings, known)
    allowed = hypotheses.facing(facings) if hypotheses is not None else None
    ours = len(theta) - (0 if allowed is None else int(settings.proposed * len(theta)))
    if allowed is not None:  # the rest is the network's
        length_mm = method.shape.palm_length_mm
        drawn = allowed.draw(len(theta) - ours, view.intrinsics, length_mm, rng)
        theta[ours:], R[ours:], t[ours:] = np.clip(drawn[0], *LIMITS.T), drawn[1], drawn[2]
    overlap_of = partial(capsule_overlap, method.hand)
    shared = repeat(view.intrinsics), repeat(bits), repeat(line_mm)
    parts = (np.array_split(a, SCORED_IN) for a in (theta, R, t))
    score = np.concatenate(each(overlap_of, *parts, *shared))
    std = np.full(20, np.radians(30.0))
    few = settings.proposed_kept if ours < len(theta) else 0
    best = diverse(score, R, theta, settings.kept - few)
    best += [ours + k for k in diverse(score[ours:], R[ours:], theta[ours:], few)]
    starts = [Estimate(Pose(R[k], t[k]), theta[k], std) for k in dict.fromkeys(best)]
    found = facing_as_told(each(method.settle, repeat(view), starts), facings)
    if not found:
        return None
    agreement = overlaps(method.hand, found, view, bits, line_mm)
    order = finalists_of(agreement, found, settings.finalists)
    finalists = [found[k] for k in order]
    for _ in range(settings.searches):
        finalists = each(method.search, repeat(view), finalists, rng.spawn(len(finalists)))
    finalists = facing_as_told(finalists, facings)
    if not finalists:
        return None
    agreement = overlaps(method.hand, finalists, view, bits, line_mm)
    near = agreement > agreement.max() - settings.overlap_margin
    seen = np.array([outline_seen(e, view, line_mm) for e in finalists])
    full = seen >= settings.outline_share * seen.max()
    near &= full | ~(near & full).any()  # none of the best may be full
    cost = np.array([e.energy + facing_cost * (facing_of(e) != usual) for e in finalists])
    if hypotheses is not None:
        told = [hypotheses.log_density(e.theta, e.pose.R) for e in finalists]
        cost -= settings.told * np.array(told)
    chosen = int(np.argmin(np.where(near, cost, np.inf)))
    return finalists[chosen], float(agreement[chosen])


def finalists_of(agreement: Array, found: list[Estimate], most: int) -> list[int]:
    """Indices of the best overlaps, at least one of them of each side of the hand."""
    order = [int(k) for k in np.argsort(-agreement)]
    chosen = order[:most]
    for side in ("palm", "back"):
        this_side = [k for k in order if facing_of(found[k]) == side]
        if this_side and not set(this_side) & set(chosen):
            chosen[-1] = this_side[0]
    return chosen


def facing_as_told(estimates: list[Estimate], facings: tuple[str, ...]) -> list[Estimate]:
    """Those that show one of some sides of the hand: refinement may turn a hand over."""
    return [
        e
        for e in estimates
        if any(FACING[f][2, 2] * e.pose.R[2, 2] > -PAST_EDGE_ON for f in facings)
    ]


def facing_of(estimate: Estimate) -> Shown:
    """ "palm" where the palm's normal points to the camera, else "back"."""
    return "palm" if estimate.pose.R[2, 2] < 0 else "back"


def draw_seeds(
    view: View,
    method: RefinedMethod,
    discs: list[tuple[Array, float]],
    facings: tuple[str, ...],
    rng: np.random.Generator,
    settings: SeedSettings,
    known: Estimate | None,
) -> tuple[Array, Array, Array]:
    """Angles ``(n, 20)``, rotations ``(n, 3, 3)`` and translations ``(n, 3)``."""
    n = settings.seeds
    shape = method.shape
    fx, fy, cx, cy = view.intrinsics
    which = rng.integers(len(discs), size=n)
    centre = np.array([d[0] for d in discs])[which]
    radius = np.array([d[1] for d in discs])[which]
    # the palm's largest disc: its centre a little over half way to the knuckles
    palm_centre = np.array([-0.03, 0.52, 0.0]) * shape.palm_length_mm
    disc_mm = 0.5 * float(np.ptp(shape.palm_outline_mm[:, 0])) * 0.92
    z = fx * disc_mm / radius * np.exp(rng.normal(0, settings.depth_std, n))
    if known is not None:
        known_z = known.pose.t_mm[2]
        z[::2] = known_z * np.exp(rng.normal(0, 0.5 * settings.depth_std, len(z[::2])))
        z = np.clip(z, known_z / MAX_DEPTH_RATIO, known_z * MAX_DEPTH_RATIO)
    spin = rotation.about_z(draw_directions(view, n, rng, known))
    tilt = rotation.exp(
        np.column_stack([rng.normal(0, np.radians(settings.tilt_std_deg), (n, 2)), np.zeros(n)])
    )
    face = np.array([FACING[f] for f in facings])[rng.integers(len(facings), size=n)]
    # tilt about the image's axes, relative to the line of sight
    at = np.column_stack([(centre - (cx, cy)) / (fx, fy), np.ones(n)]) * z[:, None]
    R = tilt @ spin @ face
    t = at - np.einsum("nij,j->ni", R, palm_centre)
    theta = draw_configurations(method.space, n, rng)
    if known is not None:
        theta[: n // 8] = known.theta
    return theta, R, t


def draw_directions(view: View, n: int, rng: np.random.Generator, known: Estimate | None) -> Array:
    """Angles ``(n,)`` in the image by which the fingers' direction is turned from straight up.

    Arms do not turn over: about a known direction, or else away from where the silhouette leaves
    the frame, the angles are within 100 deg; with neither, anywhere.
    """
    towards = fingers_from(view, known)
    if towards is None:
        return rng.uniform(-np.pi, np.pi, n)
    return np.asarray(towards + rng.uniform(-1, 1, n) * np.radians(100))


def fingers_from(view: View, known: Estimate | None) -> float | None:
    """The angle in the image, from straight up, to which fingers point, or None if unknown."""
    x, y = from_the_border(view) if known is None else known.pose.R[:2, 1]
    return None if x == 0 and y == 0 else float(np.arctan2(x, -y))


def from_the_border(view: View) -> tuple[float, float]:
    """Direction from where the silhouette crosses the frame's border to its middle, or 0, 0."""
    x0, y0, x1, y1 = view.valid.astype(int)
    inside = view.sdf[y0:y1, x0:x1] < 0
    rim = np.zeros_like(inside)
    rim[[0, -1], :] = rim[:, [0, -1]] = True
    crossing = np.argwhere(inside & rim)
    if len(crossing) < 4:
        return 0.0, 0.0
    way = np.argwhere(inside).mean(axis=0) - crossing.mean(axis=0)
    return float(way[1]), float(way[0])


def draw_configurations(space: ConfigurationSpace, n: int, rng: np.random.Generator) -> Array:
    """Angles ``(n, 20)``: half at basis states, half on the lines between two of them."""
    theta = space.to_angles(space.basis_X)
    i, j = rng.integers(len(theta), size=(2, n))
    s = np.where(rng.random(n) < 0.5, 0.0, rng.random(n))[:, None]
    return np.asarray((1 - s) * theta[i] + s * theta[j])


def diverse(score: Array, R: Array, theta: Array, most: int) -> list[int]:
    """Indices of high scores that differ in direction (15 deg) or in some finger (40 deg)."""
    chosen: list[int] = []
    for k in np.argsort(-score)[: 40 * most]:
        new = all(
            rotation.angle_between(R[k], R[c]) > np.radians(15)
            or np.abs(theta[k] - theta[c]).max() > np.radians(40)
            for c in chosen
        )
        if new:
            chosen.append(int(k))
        if len(chosen) == most:
            break
    return chosen
