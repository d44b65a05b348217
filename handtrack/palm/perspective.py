"""Refine a pose under full perspective: Levenberg-Marquardt over six degrees of freedom.

A palm point ``p`` has the camera point ``X = R p + t`` and the image ``q = K X``. A small turn
``w`` about the palm's origin and a small shift ``d`` change it by::

    X -> exp(w) R p + t + d,    dq = J_q (-[R p]_x w + d),    J_q = [f/Z, 0, -f X/Z^2; ...]

A pair's error ``e = q - y`` weighs ``w (n n^T + tau (I - n n^T))``: across the edge's normal
``n`` in full, along it by the share ``tau`` (0 is point to line, 1 point to point). A prior
about a pose (the last frame's, say) adds its own precision. The cost is half the weighted sum of
squares; its Hessian at the end is the information about ``(w, d)``.

>>> import numpy as np
>>> from handtrack import rotation
>>> camera = Camera(600.0, 600.0, 320.0, 240.0, 641, 481)
>>> corners = np.array([[-40.0, 0, 0], [40, 0, 0], [40, 90, 0], [-40, 90, 0]])
>>> truth = Pose(rotation.exp([0.3, 0.5, 0.1]), np.array([20.0, -10.0, 500.0]))
>>> start = Pose(rotation.exp([0.1, 0.3, 0.0]), np.array([0.0, 0.0, 450.0]))
>>> fit = refine(corners, camera.project(truth @ corners), start, camera)
>>> fit.converged, bool(np.allclose(fit.pose.R, truth.R, atol=1e-6))
(True, True)
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]

#: A step that turns by less (radians) and shifts by less (shares of the depth) ends the search.
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class PosePrior:
    """The pose is thought to be near ``pose``: one standard deviation each way."""

    pose: Pose
    rotation_std_rad: float
    shift_std_mm: float


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Where the search ended; ``information`` ``(6, 6)`` is about the turn (rad), shift (mm)."""

    pose: Pose
    cost: float
    information: Array
    steps: int
    converged: bool
    status: PalmStatus

    def __post_init__(self) -> None:
        freeze_arrays(self)


def refine(
    points_mm: ArrayLike,
    points_px: ArrayLike,
    start: Pose,
    camera: Camera,
    weights: ArrayLike | None = None,
    normals_px: ArrayLike | None = None,
    tangential: ArrayLike = 1.0,
    prior: PosePrior | None = None,
    max_steps: int = 30,
) -> PoseFit:
    """The pose that brings the points nearest to their images, from ``start``.

    Parameters
    ----------
    points_mm : (n, 3)
        In the palm frame.
    points_px : (n, 2)
        Their images; rows that are not finite weigh nothing.
    start : Pose
        All points must be in front of the camera.
    camera : Camera
    weights : (n,), optional
        In 1/px^2 (one over the variance of an image point); all one if left out.
    normals_px : (n, 2), optional
        Unit normals of the edges.
    tangential : float or (n,)
        What an error along the edge counts, 0 to 1; 1 if there are no normals.
    prior : PosePrior, optional
    max_steps : int

    Raises
    ------
    InputError
        Shapes that do not go together.
    """
    p = np.array(points_mm, float, order="C")  # copies: kernels are compiled for writable arrays
    y = np.array(points_px, float)
    n = len(p)
    w = np.ones(n) if weights is None else np.array(weights, float)
    normals = np.zeros((n, 2)) if normals_px is None else np.array(normals_px, float)
    tau = np.ones(n) if normals_px is None else np.ones(n) * np.asarray(tangential, float)
    if p.shape != (n, 3) or not (y.shape == normals.shape == (n, 2)) or w.shape != (n,):
        raise InputError(
            f"refine: points {p.shape}, images {y.shape}, normals {normals.shape} and "
            f"weights {w.shape} do not go together"
        )
    known = np.isfinite(y).all(axis=1)
    y[~known], w[~known] = 0.0, 0.0
    if not (np.isfinite(start.R).all() and np.isfinite(start.t_mm).all()):
        return PoseFit(start, np.nan, np.zeros((6, 6)), 0, False, PalmStatus.BAD_START)
    if np.count_nonzero(w) < 3 and prior is None:
        return PoseFit(start, np.nan, np.zeros((6, 6)), 0, False, PalmStatus.TOO_FEW_POINTS)
    return search(p, y, w, normals, tau, start, camera, prior, max_steps)


def search(
    points: Array,
    pixels: Array,
    weights: Array,
    normals: Array,
    tau: Array,
    start: Pose,
    camera: Camera,
    prior: PosePrior | None,
    max_steps: int,
) -> PoseFit:
    """:func:`refine` of arrays known to be right: contiguous, finite, of agreeing shapes."""
    R0, t0, precision = _prior_arrays(prior)
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    rows = (points, pixels, weights, normals, tau)
    R, t, H, cost, steps, still = _levenberg_marquardt(
        start.R.copy(), start.t_mm.copy(), *rows, K, R0, t0, precision, max_steps
    )
    status = PalmStatus.CONVERGED if still else PalmStatus.ROUND_LIMIT
    if not np.isfinite(cost):
        status = PalmStatus.BEHIND_CAMERA
    return PoseFit(Pose(R, t), float(cost), H, int(steps), bool(still), status)


def _prior_arrays(prior: PosePrior | None) -> tuple[Array, Array, Array]:
    if prior is None:
        return np.eye(3), np.zeros(3), np.zeros(6)
    std = np.array([prior.rotation_std_rad] * 3 + [prior.shift_std_mm] * 3)
    return prior.pose.R.copy(), prior.pose.t_mm.copy(), 1 / std**2


def projection_jacobian(points_mm: Array, pose: Pose, camera: Camera) -> tuple[Array, Array]:
    """Pixels ``(n, 2)`` and their derivatives ``(n, 2, 6)`` by the turn and the shift."""
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    q, J = np.empty((len(points_mm), 2)), np.empty((len(points_mm), 2, 6))
    for n, p in enumerate(np.array(points_mm, float)):
        _project(pose.R.copy(), pose.t_mm.copy(), p, K, q[n], J[n])
    return q, J


@numba.njit(cache=True)
def _project(R, t, p, K, q, J):  # type: ignore[no-untyped-def]
    """Fill ``q (2,)`` and ``J (2, 6)`` of one point; its depth."""
    a = R[0, 0] * p[0] + R[0, 1] * p[1] + R[0, 2] * p[2]
    b = R[1, 0] * p[0] + R[1, 1] * p[1] + R[1, 2] * p[2]
    c = R[2, 0] * p[0] + R[2, 1] * p[1] + R[2, 2] * p[2]
    Z = c + t[2]
    x, y = (a + t[0]) / Z, (b + t[1]) / Z
    q[0], q[1] = K[0] * x + K[2], K[1] * y + K[3]
    for row in range(2):
        f = K[row] / Z
        u, v, s = (f, 0.0, -f * x) if row == 0 else (0.0, f, -f * y)  # dq / dX
        J[row, 0] = s * b - v * c  # (R p) x dq/dX: dX = w x R p
        J[row, 1] = u * c - s * a
        J[row, 2] = v * a - u * b
        J[row, 3], J[row, 4], J[row, 5] = u, v, s
    return Z


@numba.njit(cache=True)
def _normal_equations(  # type: ignore[no-untyped-def]
    R, t, points, pixels, weights, normals, tau, K, R0, t0, precision, H, g
):
    """Fill ``H (6, 6)``, ``g (6,)``; the cost, or infinity behind the camera."""
    H[:], g[:] = 0.0, 0.0
    cost = 0.0
    q, J, across, e, off = np.empty(2), np.empty((2, 6)), np.empty(6), np.empty(2), np.empty(6)
    for n in range(len(points)):
        if weights[n] == 0:
            continue
        if _project(R, t, points[n], K, q, J) <= 0:
            return np.inf
        w, share = weights[n], tau[n]
        e[0], e[1] = q[0] - pixels[n, 0], q[1] - pixels[n, 1]
        e_n = normals[n, 0] * e[0] + normals[n, 1] * e[1]
        cost += 0.5 * w * (share * (e[0] ** 2 + e[1] ** 2) + (1 - share) * e_n**2)
        for i in range(6):
            across[i] = normals[n, 0] * J[0, i] + normals[n, 1] * J[1, i]
        for i in range(6):
            g[i] += w * (share * (J[0, i] * e[0] + J[1, i] * e[1]) + (1 - share) * across[i] * e_n)
            for j in range(i + 1):
                both = J[0, i] * J[0, j] + J[1, i] * J[1, j]
                H[i, j] += w * (share * both + (1 - share) * across[i] * across[j])
    if precision[0] > 0 or precision[3] > 0:
        _log_between(R0, R, off)
        for i in range(3):
            off[3 + i] = t[i] - t0[i]
        for i in range(6):
            H[i, i] += precision[i]
            g[i] += precision[i] * off[i]
            cost += 0.5 * precision[i] * off[i] ** 2
    for i in range(6):
        for j in range(i):
            H[j, i] = H[i, j]
    return cost


@numba.njit(cache=True)
def _levenberg_marquardt(  # type: ignore[no-untyped-def]
    R, t, points, pixels, weights, normals, tau, K, R0, t0, precision, max_steps
):
    """Steps until still (overwrites ``R``, ``t``): pose, Hessian, cost, steps, whether at rest."""
    H, g, step = np.empty((6, 6)), np.empty(6), np.empty(6)
    H_new, g_new, R_new, t_new = np.empty((6, 6)), np.empty(6), np.empty((3, 3)), np.empty(3)
    cost = _normal_equations(
        R, t, points, pixels, weights, normals, tau, K, R0, t0, precision, H, g
    )
    damping, steps = 1e-4, 0
    while steps < max_steps and np.isfinite(cost):
        steps += 1
        _damped_step(H, g, damping, step)
        _turned(step, R, R_new)
        for i in range(3):
            t_new[i] = t[i] + step[3 + i]
        cost_new = _normal_equations(
            R_new, t_new, points, pixels, weights, normals, tau, K, R0, t0, precision, H_new, g_new
        )
        if cost_new <= cost:
            R, R_new = R_new, R
            t, t_new = t_new, t
            H, H_new = H_new, H
            g, g_new = g_new, g
            cost, damping = cost_new, max(damping / 10, 1e-12)
        else:
            damping *= 10
        turn = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        shift = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
        if (turn < STILL and shift < STILL * abs(t[2])) or damping > 1e12:
            return R, t, H, cost, steps, True
    return R, t, H, cost, steps, False


@numba.njit(cache=True)
def _damped_step(H, g, damping, step):  # type: ignore[no-untyped-def]
    """Fill ``step`` with ``-(H + damping diag H)^-1 g``, by Cholesky."""
    L = np.zeros((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = H[i, j] * (1 + damping) + 1e-12 if i == j else H[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(max(total, 1e-30)) if i == j else total / L[j, j]
    for i in range(6):
        total = -g[i]
        for k in range(i):
            total -= L[i, k] * step[k]
        step[i] = total / L[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            step[i] -= L[k, i] * step[k]
        step[i] /= L[i, i]


@numba.njit(cache=True)
def _turned(w, R, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` with ``exp(w) R`` (Rodrigues, column by column)."""
    angle2 = w[0] ** 2 + w[1] ** 2 + w[2] ** 2
    angle = np.sqrt(angle2)
    a = np.sin(angle) / angle if angle > 1e-8 else 1.0
    b = 2 * np.sin(angle / 2) ** 2 / angle2 if angle > 1e-8 else 0.5
    for c in range(3):
        x, y, z = R[0, c], R[1, c], R[2, c]
        u, v, s = w[1] * z - w[2] * y, w[2] * x - w[0] * z, w[0] * y - w[1] * x  # w x column
        out[0, c] = x + a * u + b * (w[1] * s - w[2] * v)
        out[1, c] = y + a * v + b * (w[2] * u - w[0] * s)
        out[2, c] = z + a * s + b * (w[0] * v - w[1] * u)


@numba.njit(cache=True)
def _log_between(A, B, out):  # type: ignore[no-untyped-def]
    """Fill ``out[:3]`` with the rotation vector of ``B A^T``, for less than half a turn."""
    trace = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = 0.0
        for c in range(3):
            out[i] += 0.5 * (B[k, c] * A[j, c] - B[j, c] * A[k, c])
            trace += B[i, c] * A[i, c]
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    angle = np.arctan2(sine, (trace - 1) / 2)
    for i in range(3):
        out[i] *= angle / sine if sine > 1e-9 else 1.0
