"""Unit quaternions ``(w, x, y, z)`` and dual quaternions, batched; signs are never canonised.

A product of turns keeps the sign that its half angles give it, so a finger that bends through
half a turn does not jump to the other cover, which would tear the skin that blends two bones.

>>> import numpy as np
>>> q = multiply(turn("x", np.pi / 2), turn("x", np.pi / 2))
>>> np.round(rotate(q, np.array([0.0, 1.0, 0.0])), 12).tolist()
[0.0, -1.0, 0.0]
"""

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def turn(axis: str, angle: ArrayLike) -> Array:
    """Turn by ``angle`` ``(...)`` radians about ``"x"``, ``"y"`` or ``"z"``: ``(..., 4)``."""
    half = np.asarray(angle, float) / 2
    q = np.zeros((*half.shape, 4))
    q[..., 0] = np.cos(half)
    q[..., 1 + "xyz".index(axis)] = np.sin(half)
    return q


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """The product ``p q`` ``(..., 4)``: ``q`` acts first."""
    p, q = np.asarray(p, float), np.asarray(q, float)
    w = p[..., :1] * q[..., :1] - np.sum(p[..., 1:] * q[..., 1:], axis=-1, keepdims=True)
    v = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate([w, v], axis=-1)


def conjugate(q: ArrayLike) -> Array:
    """The inverse of a unit quaternion."""
    return np.asarray(q, float) * (1.0, -1.0, -1.0, -1.0)


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """Vectors ``v`` ``(..., 3)`` turned by unit quaternions ``q`` ``(..., 4)``."""
    q, v = np.asarray(q, float), np.asarray(v, float)
    twice = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice + np.cross(q[..., 1:], twice)


def matrix(q: ArrayLike) -> Array:
    """Rotation matrices ``(..., 3, 3)``."""
    columns = [rotate(q, e) for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def dual(q: ArrayLike, t: ArrayLike) -> Array:
    """Dual quaternions ``(..., 8)`` of the motion ``x -> q x q* + t``: Kavan et al. 2008."""
    t = np.asarray(t, float)
    pure = np.concatenate([np.zeros((*t.shape[:-1], 1)), t], axis=-1)
    return np.concatenate([np.asarray(q, float), 0.5 * multiply(pure, q)], axis=-1)


def apply_dual(dq: Array, points: Array) -> Array:
    """Points ``(n, 3)`` moved by dual quaternions ``(n, 8)`` of any norm (blends)."""
    moved = np.empty((len(points), 3))
    _apply_dual(np.ascontiguousarray(dq), np.ascontiguousarray(points), moved)
    return moved


@numba.njit(cache=True)
def _apply_dual(dq, points, moved):  # type: ignore[no-untyped-def]
    """With ``q = (w, v)`` and ``e`` its dual part, ``p + 2 v x (v x p + w p) + 2 vec(e q*)``."""
    for i in range(points.shape[0]):
        norm = np.sqrt(dq[i, 0] ** 2 + dq[i, 1] ** 2 + dq[i, 2] ** 2 + dq[i, 3] ** 2)
        w, x, y, z = dq[i, 0] / norm, dq[i, 1] / norm, dq[i, 2] / norm, dq[i, 3] / norm
        ew, ex, ey, ez = dq[i, 4] / norm, dq[i, 5] / norm, dq[i, 6] / norm, dq[i, 7] / norm
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        ux, uy, uz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
        tx, ty, tz = w * ex - ew * x, w * ey - ew * y, w * ez - ew * z
        tx, ty, tz = tx + y * ez - z * ey, ty + z * ex - x * ez, tz + x * ey - y * ex
        moved[i, 0] = px + 2.0 * (y * uz - z * uy + tx)
        moved[i, 1] = py + 2.0 * (z * ux - x * uz + ty)
        moved[i, 2] = pz + 2.0 * (x * uy - y * ux + tz)
