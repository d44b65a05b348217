"""Poses of a plane in several frames at once, by factorisation (Section 3; Tomasi and Kanade).

The ``n`` points of a plane, seen in ``F`` frames, registered (less their centroid in each frame)
and stacked, are of rank two::

    W = M S      W (2F, n),  M (2F, 2): a block B_f = A_f / t3_f a frame,  S (2, n): the plane

The singular value decomposition gives ``W = Mh Sh`` up to a ``D (2, 2)``: ``M = Mh D``,
``S = D^-1 Sh``. What fixes ``D``:

- **A known plane** (the calibrated palm, or a frame known to be frontal, whose points *are* the
  plane): ``D^-1`` is the least-squares map from ``Sh`` to it. One frame is enough, and frontal
  frames are as good as others.
- **An unknown plane, depths known up to a common factor** (a hand that keeps its distance): with
  ``Q = D D^T`` and ``G_f = t3_f^2 Bh_f^T Bh_f``, each ``t3_f B_f`` has a singular value that is
  one::

      tr(Q G_f) - det(G_f) det(Q) = 1

  one equation a frame for the three numbers of ``Q``, linear in them and in ``det Q``. So three
  frames leave at most two planes, four leave one. The common factor of the depths is the size of
  the plane; it is drawn as the first frame sees it, and its front cannot be told from its back.
  Turning about one axis only leaves the stretch across that axis free, and frames that do not
  turn out of the plane (all frontal, say) leave ``Q`` free: ``NOT_TURNED``.
- **An unknown plane and unknown depths**: never. Each frame brings three equations and three
  unknowns of its own.

Each frame keeps its own two tilts (see :mod:`handtrack.palm.orthographic`).

>>> import numpy as np
>>> camera = Camera(600.0, 600.0, 320.0, 240.0, 641, 481)
>>> square = np.array([[-40.0, -45.0], [40.0, -45.0], [40.0, 45.0], [-40.0, 45.0]])
>>> result = factorise([square, square * [1.0, 0.5]], camera, plane_mm=square)
>>> result.status.value, [round(np.degrees(frame.tilt_rad)) for frame in result.frames]
('converged', [0, 60])
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.palm.orthographic import COLLINEAR_RATIO, OrthographicPose, poses_of
from handtrack.palm.status import PalmStatus
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: How far a singular value of ``t3 B`` may pass one before a plane is refused.
FEASIBLE = 1.05
#: Directions of the metric constraints weaker than this count as missing (noise raises it).
RANK_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class Factorisation:
    """The plane and its two poses in every frame; empty where the status is not usable.

    ``rms_px`` is what rank two leaves of the points. ``others`` holds the second plane if the
    status is ``TWO_PLANES``.
    """

    frames: tuple[OrthographicPose, ...]
    plane_mm: Array  # (n, 2)
    rms_px: float
    status: PalmStatus
    others: tuple["Factorisation", ...] = ()

    def __post_init__(self) -> None:
        freeze_arrays(self)


def factorise(
    points_px: ArrayLike,
    camera: Camera,
    plane_mm: ArrayLike | None = None,
    depths_mm: ArrayLike | None = None,
) -> Factorisation:
    """Factor the images of a plane's points into its poses and its shape.

    Parameters
    ----------
    points_px : (F, n, 2)
        The same ``n`` points in every frame.
    camera : Camera
        Gives focal lengths and principal point.
    plane_mm : (n, 2), optional
        The plane's points, if they are known.
    depths_mm : (F,) or float, optional
        Depths of the plane's centroid, if the plane is not; the truth times any one factor.

    Raises
    ------
    InputError
        Wrong shapes, values that are not finite, or neither the plane nor the depths given.
    """
    x = (_checked(points_px, "points_px", 3) - (camera.cx_px, camera.cy_px)) / (
        camera.fx_px,
        camera.fy_px,
    )
    n_frames, n, _ = x.shape
    x0 = x.mean(axis=1)  # (F, 2)
    W = (x - x0[:, None]).transpose(0, 2, 1).reshape(2 * n_frames, n)
    U, sigma, Vt = np.linalg.svd(W, full_matrices=False)
    if n < 3:
        return _failed(PalmStatus.TOO_FEW_POINTS)
    if sigma[1] <= COLLINEAR_RATIO * sigma[0]:
        return _failed(PalmStatus.COLLINEAR)
    Mh, Sh = U[:, :2] * sigma[:2], Vt[:2]
    rms = float(np.sqrt(np.sum(sigma[2:] ** 2) / W.size))
    noise = float(np.sqrt(np.sum(sigma[2:] ** 2)) / sigma[1])

    if plane_mm is not None:
        S = _checked(plane_mm, "plane_mm", 2)
        if S.shape != (n, 2):
            raise InputError(f"plane_mm has shape {S.shape}, wanted {(n, 2)} like the points")
        D_inverse = (S - S.mean(axis=0)).T @ Sh.T  # the rows of Sh are orthonormal
        if abs(np.linalg.det(D_inverse)) <= COLLINEAR_RATIO * np.sum(D_inverse**2):
            return _failed(PalmStatus.COLLINEAR)
        return _read_out(Mh, Sh, D_inverse, S.mean(axis=0), x0, rms, camera)
    if depths_mm is None:
        raise InputError("factorise: give plane_mm, or depths_mm if the plane is not known")
    t3 = np.broadcast_to(np.asarray(depths_mm, float), n_frames)
    if not (np.isfinite(t3) & (t3 > 0)).all():
        raise InputError("depths_mm must be positive")
    if n_frames < 3:
        return _failed(PalmStatus.TOO_FEW_FRAMES)
    upgrades, status = metric_upgrades(Mh.reshape(-1, 2, 2) * t3[:, None, None], noise)
    origin = np.zeros(2)
    found = [_read_out(Mh, Sh, D, origin, x0, rms, camera, status) for D in upgrades]
    if not found:
        return _failed(status)
    first, others = found[0], tuple(found[1:])
    return Factorisation(first.frames, first.plane_mm, rms * camera.fx_px, status, others)


def metric_upgrades(Bh: Array, noise: float = 0.0) -> tuple[list[Array], PalmStatus]:
    """Every ``D^-1 (2, 2)`` that turns ``t3 Bh`` ``(F, 2, 2)`` into parts of rotations."""
    E = Bh[np.argmax(np.abs(np.linalg.det(Bh)))]  # in its coordinates all numbers are about one
    if abs(np.linalg.det(E)) <= COLLINEAR_RATIO * np.sum(E**2):
        return [], PalmStatus.COLLINEAR
    B = Bh @ np.linalg.inv(E)
    G = np.swapaxes(B, 1, 2) @ B
    det = np.linalg.det(G)
    A = np.column_stack([G[:, 0, 0], 2 * G[:, 0, 1], G[:, 1, 1], -det])
    planes, rank = _solve_constraints(A, max(RANK_TOLERANCE, 3 * noise))
    if rank < 3:
        return [], PalmStatus.NOT_TURNED
    upgrades = []
    for q in planes:
        Q = np.array([[q[0], q[1]], [q[1], q[2]]])
        if np.linalg.eigvalsh(Q)[0] <= 0 or np.max(det) * np.linalg.det(Q) > FEASIBLE**2:
            continue
        B1 = B[0] @ np.linalg.cholesky(Q)
        U, _, Vt = np.linalg.svd(B1)
        D = np.linalg.inv(E) @ np.linalg.cholesky(Q) @ (U @ Vt).T  # so that the first B is SPD
        upgrades.append(np.linalg.inv(D))
    status = (PalmStatus.NOT_A_PLANE, PalmStatus.CONVERGED, PalmStatus.TWO_PLANES)[len(upgrades)]
    return upgrades, status


def _solve_constraints(A: Array, tolerance: float) -> tuple[list[Array], int]:
    """Solutions ``(q11, q12, q22)`` of ``A (q, det q) = 1`` and the rank of ``A``."""
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    rank = int(np.sum(sigma > tolerance * sigma[0]))
    if rank < 3:
        return [], rank
    z = Vt[:rank].T @ ((U[:, :rank].T @ np.ones(len(A))) / sigma[:rank])
    if rank == 4:
        return [_polish(A, z[:3])], rank
    v = np.linalg.svd(A, full_matrices=True)[2][3]  # z + k v, on q11 q22 - q12^2 = det
    quadratic = [
        v[0] * v[2] - v[1] ** 2,
        z[0] * v[2] + z[2] * v[0] - 2 * z[1] * v[1] - v[3],
        z[0] * z[2] - z[1] ** 2 - z[3],
    ]
    roots = np.roots(quadratic)
    real = roots.real[np.abs(roots.imag) <= 1e-6 * (1 + np.abs(roots.real))]
    planes = [_polish(A, (z + k * v)[:3]) for k in real]
    double = len(planes) == 2 and np.allclose(planes[0], planes[1], rtol=0, atol=1e-6)
    return planes[: 1 if double else 2], rank


def _polish(A: Array, q: Array, steps: int = 8) -> Array:
    """Gauss-Newton on the constraints with ``det Q`` in place of a fourth unknown."""
    for _ in range(steps):
        error = A @ [*q, q[0] * q[2] - q[1] ** 2] - 1
        J = A[:, :3] + A[:, 3:] * [q[2], -2 * q[1], q[0]]
        q = q - np.linalg.lstsq(J, error, rcond=None)[0]
    return q


def _read_out(
    Mh: Array,
    Sh: Array,
    D_inverse: Array,
    centre_mm: Array,
    x0: Array,
    rms: float,
    camera: Camera,
    status: PalmStatus = PalmStatus.CONVERGED,
) -> Factorisation:
    """Poses and plane, ``D`` being known."""
    B = (Mh @ np.linalg.inv(D_inverse)).reshape(-1, 2, 2)
    maps = zip(B, x0, strict=True)
    frames = tuple(poses_of(Bf, xf - Bf @ centre_mm, rms, centre_mm, camera) for Bf, xf in maps)
    return Factorisation(frames, (D_inverse @ Sh).T + centre_mm, rms * camera.fx_px, status)


def _failed(status: PalmStatus) -> Factorisation:
    return Factorisation((), np.empty((0, 2)), np.nan, status)


def _checked(values: ArrayLike, name: str, ndim: int) -> Array:
    array = np.asarray(values, float)
    if array.ndim != ndim or array.shape[-1] != 2 or array.size == 0:
        raise InputError(f"{name} has shape {array.shape}, wanted {ndim} axes, the last of 2")
    if not np.isfinite(array).all():
        raise InputError(f"{name} has values that are not finite; leave those points out")
    return array
