"""The two solvers of ICP: one pose from weighted pairs, near the pose before.

``solve_orthographic`` is the paper's: the affine map ``x = B p + b`` of the pairs by weighted
least squares (linear, so one step), then the quartic. Points off the plane are moved into it
first, by ``z (R13, R23) / t3`` of the pose before, and all to where they would be seen by a camera
that faces them. Of the two tilts it keeps the one nearer to that pose;
:mod:`handtrack.palm.icp` looks after the other. Near the frontal view the tilt is hardly in the
image (its cosine is), so errors of a hundredth turn the palm by eight degrees: with a prior, the
likeliest pose is taken. ``solve_perspective`` takes a few steps under full perspective.

>>> import numpy as np
>>> camera = Camera(600.0, 600.0, 320.0, 240.0, 641, 481)
>>> square = np.array([[-40.0, -45, 0], [40, -45, 0], [40, 45, 0], [-40, 45, 0]])
>>> truth = Pose(np.diag([1.0, -1.0, -1.0]), np.array([10.0, 0.0, 400.0]))
>>> pairs = Pairs.of(square, camera.project(truth @ square), np.ones(4), np.zeros((4, 2)), 1.0)
>>> start = Pose(truth.R, np.array([0.0, 0.0, 450.0]))
>>> for solve in (solve_orthographic, lambda *args: solve_perspective(*args, None)):
...     pose, _ = solve(pairs, start, camera)
...     print(np.round(pose.t_mm, 3).tolist())
[10.0, 0.0, 400.0]
[10.0, 0.0, 400.0]
"""

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.palm.orthographic import poses_of
from handtrack.palm.pairs import Pairs
from handtrack.palm.perspective import PosePrior, search
from handtrack.records import Pose

Array = NDArray[np.float64]

#: Normal equations worse conditioned than this (with all columns of one size) are singular.
SINGULAR = 1e-10
#: Steps of Gauss-Newton with a prior, and the turn (rad) that ends them.
STEPS, STILL = 6, 1e-5


def solve_orthographic(
    pairs: Pairs, before: Pose, camera: Camera, prior: PosePrior | None = None
) -> tuple[Pose, Array] | None:
    """The pose and its information ``(6, 6)``, here unknown (zeros); None if not determined."""
    p, w = pairs.points_mm, pairs.weights
    if np.count_nonzero(w) < 3:
        return None
    centre = w @ p / w.sum() * (1.0, 1.0, 0.0)
    size = np.abs(p - centre).max()
    flat = (p - centre)[:, :2] / size  # of size one
    focal = np.array([camera.fx_px, camera.fy_px])
    lift = p[:, 2:] * before.R[:2, 2] / (before @ centre)[2]
    targets = pairs.images_px - (camera.cx_px, camera.cy_px)
    # about the line of sight: what is deeper lies nearer to the axis
    depth = (before @ p)[:, 2:] / (before @ centre)[2] - 1.0
    targets = targets + depth * (w @ targets / w.sum())
    targets = targets - lift * focal
    H, g = np.zeros((6, 6)), np.zeros(6)
    _affine_equations(flat, targets, w, pairs.normals, pairs.tangential, H, g)
    spread = np.linalg.eigvalsh(H)
    if not spread[0] > SINGULAR * spread[-1]:
        return None
    affine = np.linalg.solve(H, g).reshape(2, 3) / focal[:, None]
    B = affine[:, :2] / size
    if not np.abs(B).max() > 0:
        return None
    tilts = poses_of(B, affine[:, 2] - B @ centre[:2], 0.0, centre[:2], camera).poses
    nearest = max(tilts, key=lambda pose: float(np.sum(pose.R * before.R)))  # trace R^T R'
    if prior is not None:
        nearest = _likeliest(affine.ravel(), H, nearest, prior, centre, size, focal)
    return nearest, np.zeros((6, 6))


def _likeliest(
    a: Array, H: Array, pose: Pose, prior: PosePrior, centre: Array, size: float, focal: Array
) -> Pose:
    """Gauss-Newton from ``pose`` on the map's error under ``H`` and on the prior's.

    The affine map ``a`` ``(6,)`` of the pairs and its information ``H`` are all that the pairs
    say of the pose: with ``T`` the centre, ``a = [size R_r1, size R_r2, T_r] / T_3``, r = 1, 2.
    """
    weight = np.repeat([prior.rotation_std_rad, prior.shift_std_mm], 3) ** -2.0
    R, T = pose.R, pose @ centre
    F = np.repeat(focal, 3)
    for _ in range(STEPS):
        turn = np.swapaxes(np.cross(np.eye(3)[:, None], R.T), 1, 2)  # (3, 3, 3): dR of each axis
        J = np.empty((6, 6))
        now = np.column_stack([size * R[:2, :2], T[:2]]) / T[2]
        for i in range(3):
            J[:, i] = np.column_stack([size * turn[i][:2, :2], np.zeros(2)]).ravel() / T[2]
            J[:, 3 + i] = np.column_stack([np.zeros((2, 2)), np.eye(3)[:2, i]]).ravel() / T[2]
        J[:, 5] -= now.ravel() / T[2]
        J *= F[:, None]
        off = F * now.ravel() - F * a
        away = np.concatenate([rotation.log(R @ prior.pose.R.T), T - prior.pose @ centre])
        step = -np.linalg.solve(J.T @ H @ J + np.diag(weight), J.T @ H @ off + weight * away)
        R, T = rotation.exp(step[:3]) @ R, T + step[3:]
        if np.abs(step[:3]).max() < STILL:
            break
    return Pose(R, T - R @ centre)


@numba.njit(cache=True)
def _affine_equations(p, x, weights, normals, tau, H, g):  # type: ignore[no-untyped-def]
    """Add up ``H (6, 6)``, ``g (6,)`` for ``x = [B, b] (X, Y, 1)``, row after row of ``B``."""
    a = np.ones(3)
    L = np.empty((2, 2))
    for n in range(len(p)):
        a[0], a[1] = p[n, 0], p[n, 1]
        for r in range(2):
            for c in range(2):
                across = (1 - tau[n]) * normals[n, r] * normals[n, c]
                L[r, c] = weights[n] * (across + (tau[n] if r == c else 0.0))
        for i in range(6):
            for c in range(2):
                g[i] += L[i // 3, c] * a[i % 3] * x[n, c]
            for j in range(6):
                H[i, j] += L[i // 3, j // 3] * a[i % 3] * a[j % 3]


def solve_perspective(
    pairs: Pairs, before: Pose, camera: Camera, prior: PosePrior | None, max_steps: int = 3
) -> tuple[Pose, Array] | None:
    """The pose after a few steps and its information ``(6, 6)``; None if not determined."""
    fit = search(*pairs, before, camera, prior, max_steps)
    return (fit.pose, fit.information) if np.isfinite(fit.cost) else None
