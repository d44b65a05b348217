"""The root link: three or more markers that move as one body carry the frame of the hand.

Per frame, the rigid transform that takes the root's reference ``p`` to where its markers ``q``
are seen (Kabsch: least squares over rotations)::

    H = sum (p - mean p)(q - mean q)^T = U S V^T
    R = V diag(1, 1, det(V U^T)) U^T        t = mean q - R mean p

and every marker is then expressed in the root's frame, ``R^T (x - t)``. A frame with fewer than
three root markers takes its transform from its neighbours: rotation along the shortest turn,
position along the line; both are held at the ends.

>>> p = np.array([[0.0, 0, 0], [40, 0, 0], [0, 60, 0]])
>>> link = find_root(p[None] + 5.0, p)
>>> link.t_mm.round(9).tolist(), link.bridged
([[5.0, 5.0, 5.0]], ())
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from handtrack.errors import InputError
from handtrack.mocap.markers import Gap, Markers
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Root markers closer to one line than this do not fix a rotation about it.
MIN_SPREAD_MM = 5.0
N_ROOT = 3


@dataclass(frozen=True, eq=False)
class RootLink:
    """Where the root is: ``X_world = R X_root + t_mm``.

    ``residual_mm`` is the root-mean-square distance of the markers from their fitted places; NaN
    where the frame was bridged.
    """

    R: Array  # (F, 3, 3)
    t_mm: Array  # (F, 3)
    residual_mm: Array  # (F,)
    bridged: tuple[Gap, ...]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def to_root(self, points_mm: ArrayLike) -> Array:
        """Points ``(F, n, 3)`` of the world, in the root's frame."""
        return np.einsum("fba,fnb->fna", self.R, np.asarray(points_mm, float) - self.t_mm[:, None])

    def to_world(self, points_mm: ArrayLike) -> Array:
        """Points ``(F, n, 3)`` of the root's frame, in the world."""
        X = np.asarray(points_mm, float)
        return np.einsum("fab,fnb->fna", self.R, X) + self.t_mm[:, None]


def kabsch(p: ArrayLike, q: ArrayLike) -> tuple[Array, Array]:
    """Least-squares rigid transforms ``R`` ``(..., 3, 3)``, ``t`` with ``q = R p + t``.

    ``p`` and ``q`` are ``(..., n, 3)`` and broadcast.
    """
    P, Q = np.broadcast_arrays(np.asarray(p, float), np.asarray(q, float))
    p0, q0 = P.mean(axis=-2, keepdims=True), Q.mean(axis=-2, keepdims=True)
    U, _, Vt = np.linalg.svd(np.swapaxes(P - p0, -1, -2) @ (Q - q0))
    V, Ut = np.swapaxes(Vt, -1, -2).copy(), np.swapaxes(U, -1, -2)
    V[..., 2] *= np.sign(np.linalg.det(V @ Ut))[..., None]
    R = V @ Ut
    return R, q0[..., 0, :] - np.einsum("...ab,...b->...a", R, p0[..., 0, :])


def find_root(q_mm: ArrayLike, reference_mm: ArrayLike) -> RootLink:
    """The root's transform in every frame.

    Parameters
    ----------
    q_mm : (F, n, 3) root markers as seen, NaN where not.
    reference_mm : (n, 3) their places in the root's own frame.

    Raises
    ------
    InputError
        There are fewer than three root markers, they lie on a line, or no frame shows three.
    """
    q, p = np.asarray(q_mm, float), np.asarray(reference_mm, float)
    if len(p) < N_ROOT:
        raise InputError(f"{len(p)} root markers; a rigid transform needs {N_ROOT} or more")
    if np.linalg.svd(p - p.mean(axis=0), compute_uv=False)[1] < MIN_SPREAD_MM:
        raise InputError("the root markers lie on one line: they do not fix a rotation about it")
    seen = np.isfinite(q).all(axis=-1)
    enough = seen.sum(axis=1) >= N_ROOT
    if not enough.any():
        raise InputError(f"no frame shows {N_ROOT} root markers at once")
    F = len(q)
    R, t, residual = np.empty((F, 3, 3)), np.empty((F, 3)), np.full(F, np.nan)
    for pattern in np.unique(seen[enough], axis=0):
        rows = np.flatnonzero((seen == pattern).all(axis=1))
        R[rows], t[rows] = kabsch(p[pattern], q[rows][:, pattern])
        fitted = np.einsum("fab,nb->fna", R[rows], p[pattern]) + t[rows, None]
        residual[rows] = np.sqrt(((fitted - q[rows][:, pattern]) ** 2).sum(-1).mean(-1))
    _bridge(R, t, enough)
    return RootLink(R, t, residual, tuple(_spans(enough)))


def reference_of(q_mm: ArrayLike) -> Array:
    """The root's own frame, from its markers ``(F, n, 3)`` alone: their places ``(n, 3)``.

    The shape is the mean over frames after alignment; the frame is the triangle's: origin at the
    centroid, x towards the first marker, z normal to the first three.

    Raises
    ------
    InputError
        Fewer than three markers, markers on a line, or no frame that shows them all.
    """
    q = np.asarray(q_mm, float)
    whole = q[np.isfinite(q).all(axis=(1, 2))]
    if q.shape[1] < N_ROOT:
        raise InputError(f"{q.shape[1]} root markers; a rigid transform needs {N_ROOT} or more")
    if len(whole) == 0:
        raise InputError("no frame shows all root markers at once")
    shape = whole[0]
    for _ in range(3):
        R, t = kabsch(whole, shape)
        shape = (np.einsum("fab,fnb->fna", R, whole) + t[:, None]).mean(axis=0)
    shape = shape - shape.mean(axis=0)
    x = shape[0] / np.linalg.norm(shape[0])
    z = np.cross(shape[1] - shape[0], shape[2] - shape[0])
    if np.linalg.norm(z) < MIN_SPREAD_MM**2:
        raise InputError("the root markers lie on one line: they do not fix a rotation about it")
    z = z / np.linalg.norm(z)
    z -= x * (x @ z)
    z /= np.linalg.norm(z)
    return np.asarray(shape @ np.stack([x, np.cross(z, x), z], axis=1))


def root_relative(markers: Markers, root: Sequence[str], reference_mm: Array) -> Markers:
    """All markers but the root's, in the root's frame."""
    link = find_root(markers.select(root).positions_mm, reference_mm)
    others = markers.select([label for label in markers.labels if label not in root])
    positions = link.to_root(others.positions_mm)
    return Markers(others.labels, positions, markers.rate_hz, markers.unit)


def _bridge(R: Array, t: Array, known: NDArray[np.bool_]) -> None:
    """Fill the frames that are not known from their neighbours, in place."""
    at, gaps = np.flatnonzero(known), np.flatnonzero(~known)
    if len(gaps) == 0:
        return
    inside = np.clip(gaps, at[0], at[-1])
    if len(at) == 1:
        R[gaps], t[gaps] = R[at[0]], t[at[0]]
        return
    R[gaps] = Slerp(at, Rotation.from_matrix(R[at]))(inside).as_matrix()
    t[gaps] = np.stack([np.interp(inside, at, t[at, k]) for k in range(3)], axis=1)


def _spans(known: NDArray[np.bool_]) -> list[Gap]:
    edges = np.diff(np.concatenate([[True], known, [True]]).astype(int))
    pairs = zip(np.flatnonzero(edges < 0), np.flatnonzero(edges > 0), strict=True)
    return [Gap("root", int(a), int(b) - 1) for a, b in pairs]
