"""Levenberg-Marquardt over the palm pose and the 20 angles, the manifold as a prior.

No sampling here: it slides into the nearest minimum of :mod:`handtrack.refine.residuals`, so what
it starts from (prediction, sweeps of the fingers, seeds of a restart) decides which.
"""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.hand.capsules import CapsuleHand
from handtrack.hand.skeleton import LIMITS
from handtrack.records import Pose, freeze_arrays
from handtrack.refine.residuals import image_energy, place_nodes
from handtrack.refine.view import View

Array = NDArray[np.float64]
#: A motion of many standard deviations costs no more than this: fingers stop and start, and a
#: palm, heavier, does so less.
FINGER_TAIL, PALM_TAIL = 4.0, 25.0
#: And a palm that faces another way than of late costs no more than this.
FACING_TAIL = 4.0


@dataclass(frozen=True)
class RefineSettings:
    """Weights of the energy; pixels are those of the window, where a palm is about 72 px long."""

    sigma_px: float = 3.0
    """Standard deviation of one residual, neighbours' correlation included."""
    robust_px: float = 6.0
    """Scale of the robust function."""
    silhouette_weight: float = 0.5
    """Weight of outline samples against the silhouette."""
    internal_weight: float = 0.3
    """Weight of a finger's outline before the hand against the edges there."""
    inner_weight: float = 0.15
    """Weight of the edges inside the silhouette against the fingers' outlines."""
    reach_px: int = 8
    """How far along its normal a sample looks for an edge."""
    limit_std_deg: float = 3.0
    """Softness of the joint limits."""
    wrist_line_mm: float = 6.0
    """The evidence stops this far above the wrist."""

    def weights(self) -> Array:
        """The numbers the kernels take: sigma, c^2, silhouette, internal, reach."""
        return np.array(
            [
                self.sigma_px,
                self.robust_px**2,
                self.silhouette_weight,
                self.internal_weight,
                self.reach_px,
            ]
        )


@dataclass(frozen=True, eq=False)
class Prior:
    """Gaussians on the angles and the pose.

    The paper's manifold, one digit at a time: ``E = sum_d min_s (theta_d - e - s u)' P (theta_d -
    e - s u) + sum rho(w r)`` with ``0 <= s <= 1``, so that a digit slides freely between its
    extended and its curled state and pays for leaving the line. Half-way costs a finger a little,
    ``4 b s (1 - s)``: a bend and a shorter finger look alike, and recorded hands are at the ends
    five to ten times as often. The second sum runs over the differences ``r`` from the prediction,
    ``[log(R R0'), t - t0, theta - angle]``, each over its standard deviation; ``rho`` saturates at
    ``PALM_TAIL`` and ``FINGER_TAIL``.
    """

    lines: Array  # (5, 2, 4) extended state e, curled state e + u
    precision: Array  # (5, 4, 4) P
    angle: Array  # (20,) predicted
    angle_weight: Array  # (20,) 1 / rad^2
    pose: Pose
    pose_weight: Array  # (6,) 1 / rad^2, 1 / mm^2
    between: float  # b, energy of a finger half-way along its line
    facing: Array  # (3,) where the palm has faced of late, camera frame
    facing_weight: float  # 1 / rad^2

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @cached_property
    def arrays(self) -> tuple[Array | float, ...]:
        """What the kernels take; copies, since they are compiled for writable arrays only."""
        arrays = (
            self.lines, self.precision, self.angle, self.angle_weight,
            self.pose.R, self.pose.t_mm, self.pose_weight, self.facing,
        )  # fmt: skip
        return *map(np.array, arrays), float(self.between), float(self.facing_weight)


@dataclass(frozen=True, eq=False)
class Refined:
    """Where a refinement ended: estimate, energy (and its image part), information matrix."""

    pose: Pose
    theta: Array  # (20,)
    energy: float
    image_energy: float
    information: Array  # (26, 26), of (w, v, theta)
    iterations: int

    def __post_init__(self) -> None:
        freeze_arrays(self)


class Refiner:
    """Refinement for one hand shape; holds the flat arrays the kernels want."""

    def __init__(self, hand: CapsuleHand, settings: RefineSettings) -> None:
        self.hand, self.settings = hand, settings
        shape = hand.shape
        self.sizes = (
            np.array(shape.base_mm),
            np.array(hand.rest),
            np.array(shape.length_mm),
            hand.node_from,
            hand.node_weight,
            hand.node_offset,
            hand.node_radius_mm,
            hand.node_digit,
        )
        self.parts = (hand.capsule_node, hand.capsule_digit, hand.capsule_bone)
        self.limits, self.weights = np.array(LIMITS), settings.weights()

    def weigh(self, view: View, pose: Pose, theta: Array, prior: Prior) -> tuple[float, float]:
        """Image energy and whole energy of a hand as it is."""
        image, whole = total_energy(
            np.array(pose.R), np.array(pose.t_mm), np.array(theta, float),
            self.sizes, self.parts, self.contour(view, pose), self.inner(view, pose),
            view.maps, view.intrinsics,
            self.weights, prior.arrays, self.limits,
            np.radians(self.settings.limit_std_deg), np.empty((0, 0)), np.empty(0),
        )  # fmt: skip
        return float(image), float(whole)

    def contour(self, view: View, pose: Pose) -> Array:
        """Contour points with weights ``(m, 5)`` as the kernels take them."""
        return view.weighted(view.outline, pose, self.settings.wrist_line_mm)

    def inner(self, view: View, pose: Pose) -> Array:
        """Edges inside the silhouette ``(k, 5)`` as the kernels take them."""
        edges = view.weighted(view.inner, pose, self.settings.wrist_line_mm)
        edges[:, 4] *= self.settings.inner_weight
        return edges

    def __call__(
        self, view: View, pose: Pose, theta: Array, prior: Prior, steps: int, free: str = "all"
    ) -> Refined:
        """Refine from ``pose`` and ``theta`` ``(20,)``, ``free`` being "all", "palm" or "fingers".

        Returns
        -------
        Refined
            Never worse than the start, in energy.
        """
        mask = np.ones(26, dtype=np.bool_)
        if free == "palm":
            mask[6:] = False
        elif free == "fingers":
            mask[:6] = False
        R, t, angles, energy, image, H, iterations = levenberg_marquardt(
            np.array(pose.R), np.array(pose.t_mm), np.array(theta, float),
            self.sizes, self.parts, self.contour(view, pose), self.inner(view, pose),
            view.maps, view.intrinsics,
            self.weights, prior.arrays, self.limits,
            np.radians(self.settings.limit_std_deg), mask, steps,
        )  # fmt: skip
        return Refined(Pose(R, t), angles, energy, image, H, iterations)


@numba.njit(cache=True, nogil=True)
def so3_exp(w):  # type: ignore[no-untyped-def]
    """Rodrigues' formula for a rotation vector ``(3,)``."""
    a2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    a = np.sqrt(a2)
    s = 1.0 - a2 / 6.0 if a < 1e-4 else np.sin(a) / a
    c = 0.5 - a2 / 24.0 if a < 1e-4 else (1.0 - np.cos(a)) / a2
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + s * W + c * (W @ W)


@numba.njit(cache=True, nogil=True)
def so3_log(R):  # type: ignore[no-untyped-def]
    """Rotation vector ``(3,)`` of a matrix well short of half a turn."""
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    s = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    angle = np.arctan2(s, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0))
    return v if s < 1e-9 else v * (angle / s)


@numba.njit(cache=True, nogil=True, fastmath=True)
def line_energy(d, theta, line, P, between, H, g):  # type: ignore[no-untyped-def]
    """Squared distance of digit ``d`` to its line in the metric ``P``, and what the foot costs.

    The foot ``s`` lies between the ends and costs ``4 between s (1 - s)``. Adds to ``H`` and ``g``
    unless they are empty; the foot minimises the distance, whose derivative needs none of the
    foot's own. The cost's curvature is negative and stays out of ``H``.
    """
    Pu, delta = np.empty(4), np.empty(4)
    uPu, uPd = 0.0, 0.0
    for i in range(4):
        delta[i] = theta[4 * d + i] - line[0, i]
        Pu[i] = 0.0
        for j in range(4):
            Pu[i] += P[i, j] * (line[1, j] - line[0, j])
    for i in range(4):
        uPu += (line[1, i] - line[0, i]) * Pu[i]
        uPd += delta[i] * Pu[i]
    s = uPd / uPu
    inside = 0.0 < s < 1.0
    s = min(max(s, 0.0), 1.0)
    for i in range(4):
        delta[i] -= s * (line[1, i] - line[0, i])
    energy = 0.0
    for i in range(4):
        pull = 0.0
        for j in range(4):
            pull += P[i, j] * delta[j]
            if len(g):
                along = Pu[i] * Pu[j] / uPu if inside else 0.0
                H[6 + 4 * d + i, 6 + 4 * d + j] += P[i, j] - along
        energy += delta[i] * pull
        if len(g):
            g[6 + 4 * d + i] += pull
            if inside:
                g[6 + 4 * d + i] += 2.0 * between * (1.0 - 2.0 * s) * Pu[i] / uPu
    return energy + 4.0 * between * s * (1.0 - s)


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")
def heavy_tailed(q, r, weight, tail, H, g):  # type: ignore[no-untyped-def]
    """Robust square of one difference from the prediction, with its derivatives."""
    z2 = weight * r * r
    if len(g):
        weight *= (tail / (tail + z2)) ** 2
        g[q] += weight * r
        H[q, q] += weight
    return tail * z2 / (tail + z2)


@numba.njit(cache=True, nogil=True, fastmath=True)
def digit_prior(d, theta, prior, limits, limit_std, H, g):  # type: ignore[no-untyped-def]
    """The prior's terms of one digit: its line, its last angles, its limits."""
    lines, precision, angle, angle_weight = prior[0], prior[1], prior[2], prior[3]
    between = prior[8] if d > 0 else 0.0  # a thumb has no such ends
    energy = line_energy(d, theta, lines[d], precision[d], between, H, g)
    for a in range(4 * d, 4 * d + 4):
        energy += heavy_tailed(6 + a, theta[a] - angle[a], angle_weight[a], FINGER_TAIL, H, g)
        excess = min(theta[a] - limits[a, 0], 0.0) + max(theta[a] - limits[a, 1], 0.0)
        energy += (excess / limit_std) ** 2
        if len(g) and excess != 0.0:
            g[6 + a] += excess / limit_std**2
            H[6 + a, 6 + a] += 1.0 / limit_std**2
    return energy


@numba.njit(cache=True, nogil=True)
def prior_energy(R, t, theta, prior, limits, limit_std, H, g):  # type: ignore[no-untyped-def]
    """Prior, temporal and limit terms; adds to ``H`` and ``g`` unless they are empty."""
    R0, t0, pose_weight = prior[4], prior[5], prior[6]
    turn = so3_log(R @ R0.T)
    energy = 0.0
    for q in range(3):
        energy += heavy_tailed(q, turn[q], pose_weight[q], PALM_TAIL, H, g)
        energy += heavy_tailed(3 + q, t[q] - t0[q], pose_weight[3 + q], PALM_TAIL, H, g)
    energy += facing_energy(R[:, 2], prior[7], prior[9], H, g)
    for d in range(5):
        energy += digit_prior(d, theta, prior, limits, limit_std, H, g)
    return energy


@numba.njit(cache=True, nogil=True)
def facing_energy(n, facing, weight, H, g):  # type: ignore[no-untyped-def]
    """Robust square of ``n - facing``: of the palm's normal and where it has faced of late."""
    r = n - facing
    z2 = weight * np.sum(r * r)
    if len(g) and weight > 0.0:
        weight *= (FACING_TAIL / (FACING_TAIL + z2)) ** 2
        J = np.array([[0.0, n[2], -n[1]], [-n[2], 0.0, n[0]], [n[1], -n[0], 0.0]])  # w x n
        g[:3] += weight * (J.T @ r)
        H[:3, :3] += weight * (J.T @ J)
    return FACING_TAIL * z2 / (FACING_TAIL + z2)


@numba.njit(cache=True, nogil=True)
def total_energy(  # type: ignore[no-untyped-def]
    R, t, theta, sizes, parts, contour, inner, maps, K, weights, prior, limits, limit_std, H, g
):
    """Image part and whole of ``E``; fills ``H`` and ``g`` (zeros on entry) unless empty."""
    n = len(sizes[4])
    circles = np.empty((n, 4))
    Jc = np.empty((n, 3, 10))
    place_nodes(theta, R, t, sizes, K, circles, Jc)
    image = image_energy(
        circles, parts[0], parts[1], parts[2], contour, inner, maps, weights, Jc, H, g
    )
    return image, image + prior_energy(R, t, theta, prior, limits, limit_std, H, g)


@numba.njit(cache=True, nogil=True)
def levenberg_marquardt(  # type: ignore[no-untyped-def]
    R,
    t,
    theta,
    sizes,
    parts,
    contour,
    inner,
    maps,
    K,
    weights,
    prior,
    limits,
    limit_std,
    free,
    steps,
):
    """At most ``steps`` damped Gauss-Newton steps; the damping is Marquardt's."""
    H, g = np.zeros((26, 26)), np.zeros(26)
    H1, g1 = np.empty((26, 26)), np.empty(26)
    image, energy = total_energy(
        R, t, theta, sizes, parts, contour, inner, maps, K, weights, prior, limits, limit_std, H, g
    )
    damping, done = 1e-2, 0
    for step in range(steps):
        done = step + 1
        A, b = H.copy(), g.copy()
        for i in range(26):
            A[i, i] += damping * max(H[i, i], 1e-6)
            if not free[i]:
                A[i, :] = 0.0
                A[:, i] = 0.0
                A[i, i] = 1.0
                b[i] = 0.0
        x = -np.linalg.solve(A, b)
        R1, t1, theta1 = so3_exp(x[:3]) @ R, t + x[3:6], theta + x[6:]
        # most steps are taken, so their system is worked out at once
        H1[:], g1[:] = 0.0, 0.0
        image1, energy1 = total_energy(
            R1, t1, theta1, sizes, parts, contour, inner, maps, K, weights,
            prior, limits, limit_std, H1, g1,
        )  # fmt: skip
        if energy1 < energy:
            small = energy - energy1 < 1e-3 * energy
            R, t, theta, image, energy = R1, t1, theta1, image1, energy1
            H, H1, g, g1 = H1, H, g1, g
            damping = max(damping * 0.3, 1e-5)
            if small:
                break
        else:
            damping *= 6.0
            if damping > 1e6:
                break
    return R, t, theta, energy, image, H, done
