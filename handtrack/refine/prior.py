"""What is believed of a hand before a frame is seen, as energy with its Gauss-Newton system.

Three beliefs, all robust where a hand may be otherwise (Geman and McClure's ``rho``): each digit
lies near the line between its extended and its curled state (the paper's linear manifolds,
Section 4.1, one digit at a time); palm and angles are near their prediction; the palm faces as it
has of late (:mod:`handtrack.refine.facing`). Joint limits are soft walls.
"""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]
#: A motion of many standard deviations costs no more than this: fingers stop and start, and a
#: palm, heavier, does so less.
FINGER_TAIL, PALM_TAIL = 4.0, 25.0
#: And one that is told of no more than this.
TOLD_TAIL = 4.0
#: And a palm that faces another way than of late costs no more than this.
FACING_TAIL = 4.0


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
    told: Array  # (20,) angles as the proposer tells them from the picture
    told_weight: Array  # (20,) 1 / rad^2

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @cached_property
    def arrays(self) -> tuple[Array | float, ...]:
        """What the kernels take; copies, since they are compiled for writable arrays only."""
        arrays = (
            self.lines, self.precision, self.angle, self.angle_weight,
            self.pose.R, self.pose.t_mm, self.pose_weight, self.facing, self.told, self.told_weight,
        )  # fmt: skip
        return *map(np.array, arrays), float(self.between), float(self.facing_weight)


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
    told, told_weight = prior[8], prior[9]
    between = prior[10] if d > 0 else 0.0  # a thumb has no such ends
    energy = line_energy(d, theta, lines[d], precision[d], between, H, g)
    for a in range(4 * d, 4 * d + 4):
        energy += heavy_tailed(6 + a, theta[a] - angle[a], angle_weight[a], FINGER_TAIL, H, g)
        energy += heavy_tailed(6 + a, theta[a] - told[a], told_weight[a], TOLD_TAIL, H, g)
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
    energy += facing_energy(R[:, 2], prior[7], prior[11], H, g)
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
