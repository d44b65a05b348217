"""Pose of planar points under scaled orthography, with both of its tilts (Section 3, Appendix).

A plane's points ``p = (X, Y, 0)``, all at about the depth ``t3``, have normalised image points
(pixels less the principal point, over the focal length)::

    x = B p + b,    B = A / t3,    A = [[R11, R12], [R21, R22]]

The third row follows from the first two columns of ``R`` being orthonormal. With
``g11 = B11^2 + B21^2``, ``g22 = B12^2 + B22^2``, ``g12 = B11 B12 + B21 B22`` (that is
``G = B^T B``) they say::

    t3^2 g11 + R31^2 = 1,   t3^2 g22 + R32^2 = 1,   t3^2 g12 + R31 R32 = 0        (12), (13)

Eliminating ``t3`` and ``R32`` leaves a quartic in ``R31`` that is a quadratic in ``y = R31^2``::

    (g11 g22 - g12^2) y^2 - (g11 g22 - 2 g12^2 - g11^2) y - g12^2 = 0             (14)

The product of its roots is not positive, so exactly one serves. Solved that way it is 0/0 for a
frontal plane (``g12 = 0`` and ``R31 = 0``). But (12) and (13) read ``t3^2 G = I - u u^T`` with
``u = (R31, R32)``: the larger eigenvalue of ``G`` is ``1 / t3^2`` and its gap to the smaller one
is ``|u|^2 / t3^2``. So with ``tau``, ``delta`` the half sum and difference of ``g11``, ``g22``
and ``rho = hypot(delta, g12)``::

    t3^2 = 1 / (tau + rho),   R31^2 = t3^2 (rho - delta),   R32^2 = t3^2 (rho + delta)

which is (12) to (14) in closed form, and smooth through the frontal plane. Only ``R31 R32`` has
a sign, so ``+u`` and ``-u`` have **the same image**: the two tilts. Both are returned.

>>> import numpy as np
>>> from handtrack import rotation
>>> R = rotation.exp(np.array([0.4, -0.2, 1.0]))
>>> tilts, t3 = tilts_of(R[:2, :2] / 500.0)
>>> round(float(t3), 6), [bool(np.allclose(tilt, R)) for tilt in tilts].count(True)
(500.0, 1)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose

Array = NDArray[np.float64]

#: Points whose spread across is less than this share of their spread along are a line.
COLLINEAR_RATIO = 1e-9
#: Normalised image points (square roots of weights included) nearer than this are one point.
ONE_POINT = 1e-12


@dataclass(frozen=True, eq=False)
class OrthographicPose:
    """Both poses of one plane; they differ only in the sign of ``R31, R32`` (and what follows).

    ``tilt_rad`` is the angle between the plane's normal and the line of sight, 0 when frontal.
    ``rms_px`` is what the affine map leaves of the points. No poses if the status is not usable.
    """

    poses: tuple[Pose, ...]  # two, or none
    tilt_rad: float
    rms_px: float
    status: PalmStatus


def orthographic_pose(
    plane_mm: ArrayLike,
    points_px: ArrayLike,
    camera: Camera,
    weights: ArrayLike | None = None,
    line_of_sight: bool = False,
) -> OrthographicPose:
    """Both poses of a plane from point pairs, by weighted least squares.

    Parameters
    ----------
    plane_mm : (n, 2)
        Points of the plane ``z = 0`` in the palm frame.
    points_px : (n, 2)
        Their image points.
    camera : Camera
        Gives focal lengths and principal point.
    weights : (n,), optional
        Not negative; all one if left out.
    line_of_sight : bool
        Turn the camera to face the points first. The paper's model is about the optical axis;
        real hands are beside it, and their tilts mirror about the line of sight.

    Raises
    ------
    InputError
        The points do not come in pairs, or a weight is negative or missing.
    """
    p, y, w = _checked_pairs(plane_mm, points_px, weights)
    if np.count_nonzero(w) < 3:
        return OrthographicPose((), np.nan, np.nan, PalmStatus.TOO_FEW_POINTS)
    x = (y - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    centre_ray = np.append(np.average(x, axis=0, weights=w), 1.0)
    R_cam_sight = sight_rotation(centre_ray).T if line_of_sight else np.eye(3)
    rays = np.column_stack([x, np.ones(len(x))]) @ R_cam_sight
    fit = fit_affine(p, rays[:, :2] / rays[:, 2:], w)
    if fit is None:
        return OrthographicPose((), np.nan, np.nan, PalmStatus.COLLINEAR)
    centre = np.average(p, axis=0, weights=w)
    return poses_of(*fit, centre, camera, R_cam_sight)


def poses_of(
    B: Array,
    b: Array,
    rms: float,
    centre_mm: Array,
    camera: Camera,
    R_cam_sight: Array | None = None,
) -> OrthographicPose:
    """Both poses of the affine map ``B (2, 2)``, ``b (2,)`` of points about ``centre_mm (2,)``."""
    R_cam_sight = np.eye(3) if R_cam_sight is None else R_cam_sight
    tilts, t3 = tilts_of(B)
    t_sight = t3 * np.append(b, 1.0)  # the image of the palm's origin, at the plane's depth
    poses = []
    for R in tilts:
        lean = np.array([0.0, 0.0, R[2, :2] @ centre_mm])  # it is the centre whose depth is t3
        poses.append(Pose(R_cam_sight @ R, R_cam_sight @ (t_sight - lean)))
    tilt = float(np.arctan2(np.hypot(*tilts[0, 2, :2]), abs(tilts[0, 2, 2])))
    return OrthographicPose(tuple(poses), tilt, rms * camera.fx_px, PalmStatus.CONVERGED)


def fit_affine(p: Array, x: Array, w: Array) -> tuple[Array, Array, float] | None:
    """``B (2, 2)``, ``b (2,)`` of ``x = B p + b`` by weighted least squares, and its rms.

    None if the points ``p``, three or more of them of some weight, are collinear, or if all
    images ``x`` are one point.
    """
    p0, x0 = np.average(p, axis=0, weights=w), np.average(x, axis=0, weights=w)
    root = np.sqrt(w)[:, None]
    P, X = root * (p - p0), root * (x - x0)
    U, spread, Vt = np.linalg.svd(P, full_matrices=False)
    if spread[1] <= COLLINEAR_RATIO * spread[0] or np.abs(X).max() <= ONE_POINT:
        return None
    B = (Vt.T @ ((U.T @ X) / spread[:, None])).T
    rms = float(np.sqrt(np.sum((X - P @ B.T) ** 2) / w.sum()))
    return B, x0 - B @ p0, rms


def tilts_of(B: ArrayLike) -> tuple[Array, Array]:
    """Both rotations ``(..., 2, 3, 3)`` and the depth ``t3`` ``(...)`` of maps ``(..., 2, 2)``."""
    B = np.asarray(B, float)
    b11, b12, b21, b22 = B[..., 0, 0], B[..., 0, 1], B[..., 1, 0], B[..., 1, 1]
    g11, g12, g22 = b11 * b11 + b21 * b21, b11 * b12 + b21 * b22, b12 * b12 + b22 * b22
    tau, delta = (g11 + g22) / 2, (g11 - g22) / 2
    rho = np.hypot(delta, g12)
    t3 = 1 / np.sqrt(tau + rho)
    # the larger of R31^2, R32^2 is a sum; the other follows from g12 without cancellation
    large = np.sqrt(rho + np.abs(delta))
    small = np.divide(-g12, large, out=np.zeros_like(large), where=large > 0)
    R = np.empty((*B.shape[:-2], 2, 3, 3))
    R[..., :2, :2] = (B * t3[..., None, None])[..., None, :, :]
    R[..., 0, 2, 0] = np.where(delta < 0, large, small) * t3
    R[..., 0, 2, 1] = np.where(delta < 0, small, large) * t3
    R[..., 1, 2, :2] = -R[..., 0, 2, :2]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # the third column is across the two
        R[..., i, 2] = R[..., j, 0] * R[..., k, 1] - R[..., k, 0] * R[..., j, 1]
    return R, t3


def other_tilt(pose: Pose, centre_mm: ArrayLike, line_of_sight: bool = True) -> Pose:
    """The pose whose plane ``z = 0`` has (to first order) the same image as that of ``pose``.

    With ``v`` the line of sight to ``centre_mm`` ``(3,)``, which stays where it is::

        R' = (I - 2 v v^T) R diag(1, 1, -1)

    that is, R31 and R32 change sign in a camera that faces the palm (``v = (0, 0, 1)`` without
    ``line_of_sight``, as in the paper).
    """
    c = np.asarray(centre_mm, float)
    X = pose @ c
    v = X / np.linalg.norm(X) if line_of_sight else np.array([0.0, 0.0, 1.0])
    R = (np.eye(3) - 2 * np.outer(v, v)) @ pose.R @ np.diag([1.0, 1.0, -1.0])
    return Pose(R, X - R @ c)


def sight_rotation(direction: ArrayLike) -> Array:
    """The least turn ``(3, 3)`` that takes ``direction`` ``(3,)`` to the z axis."""
    d = np.asarray(direction, float) / np.linalg.norm(direction)
    axis = np.cross(d, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, d[2])
    return rotation.exp(axis / sine * angle if sine > 0 else np.zeros(3))


def _checked_pairs(
    plane_mm: ArrayLike, points_px: ArrayLike, weights: ArrayLike | None
) -> tuple[Array, Array, Array]:
    """The pairs as float arrays; rows that are not finite weigh nothing."""
    p, y = np.array(plane_mm, float), np.array(points_px, float)
    if p.ndim != 2 or p.shape[1] != 2 or p.shape != y.shape:
        raise InputError(f"palm points: {p.shape} and {y.shape}, wanted (n, 2) twice")
    w = np.ones(len(p)) if weights is None else np.array(weights, float)
    if w.shape != (len(p),) or not (w >= 0).all():
        raise InputError(f"palm points: weights {w.shape} must be {len(p)} numbers >= 0")
    known = np.isfinite(p).all(1) & np.isfinite(y).all(1)
    p[~known], y[~known], w[~known] = 0.0, 0.0, 0.0
    return p, y, w
