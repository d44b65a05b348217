"""Rotations: vectors, matrices, unit quaternions ``(w, x, y, z)``; all axes batched.

``exp`` and ``log`` are the maps between rotation vectors and matrices (Rodrigues); both are
exact near zero, and ``log`` near half a turn, by way of the quaternion.

>>> import numpy as np
>>> R = exp(np.array([0.0, 0.0, np.pi / 2]))
>>> np.round(R @ [1.0, 0.0, 0.0], 12).tolist()
[0.0, 1.0, 0.0]
>>> np.allclose(log(R), [0.0, 0.0, np.pi / 2])
True
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def exp(rotvec: ArrayLike) -> Array:
    """Matrices ``(..., 3, 3)`` of rotation vectors ``(..., 3)`` in radians."""
    vector = np.array(rotvec, float)  # SciPy wants it writable
    return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*vector.shape[:-1], 3, 3)


def log(matrix: ArrayLike) -> Array:
    """Rotation vectors ``(..., 3)`` in radians, norm at most pi, of matrices ``(..., 3, 3)``."""
    R = np.array(matrix, float)
    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(*R.shape[:-2], 3)


def angle_between(A: ArrayLike, B: ArrayLike) -> Array:
    """Angle in radians of the rotation that takes ``A`` to ``B``, both ``(..., 3, 3)``.

    From the chord ``|A - B| = 2 sqrt(2) sin(angle / 2)`` (Frobenius norm).
    """
    chord = np.linalg.norm(np.asarray(A, float) - np.asarray(B, float), axis=(-2, -1))
    return np.asarray(2 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0)))


def to_quaternion(matrix: ArrayLike) -> Array:
    """Unit quaternions ``(..., 4)`` as ``(w, x, y, z)`` with ``w >= 0``."""
    R = np.array(matrix, float)
    xyzw = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True)
    return np.roll(xyzw, 1, axis=-1).reshape(*R.shape[:-2], 4)


def from_quaternion(wxyz: ArrayLike) -> Array:
    """Matrices ``(..., 3, 3)`` of quaternions ``(..., 4)`` as ``(w, x, y, z)``, any norm but 0."""
    q = np.array(wxyz, float)
    xyzw = np.roll(q.reshape(-1, 4), -1, axis=-1)
    return Rotation.from_quat(xyzw).as_matrix().reshape(*q.shape[:-1], 3, 3)


def about_x(angle: ArrayLike) -> Array:
    """Turn by ``angle`` ``(...)`` radians about x: y towards z (flexion)."""
    return exp(np.asarray(angle, float)[..., None] * np.array([1.0, 0.0, 0.0]))


def about_y(angle: ArrayLike) -> Array:
    """Turn by ``angle`` ``(...)`` radians about y: z towards x."""
    return exp(np.asarray(angle, float)[..., None] * np.array([0.0, 1.0, 0.0]))


def about_z(angle: ArrayLike) -> Array:
    """Turn by ``angle`` ``(...)`` radians about z: x towards y."""
    return exp(np.asarray(angle, float)[..., None] * np.array([0.0, 0.0, 1.0]))


def slerp(a: ArrayLike, b: ArrayLike, s: ArrayLike) -> Array:
    """Unit quaternions ``(..., 4)`` at ``s`` ``(...)`` on the shortest arc from ``a`` to ``b``.

    ``q(s) = (sin((1 - s) w) a + sin(s w) b) / sin(w)`` with ``cos(w) = a . b``; ``a`` and ``b``
    have unit norm (K. Shoemake, "Animating Rotation with Quaternion Curves", 1985).

    >>> slerp([1.0, 0, 0, 0], [0.0, 0, 0, 1], 1 / 3).round(6).tolist()  # 60 of 180 degrees
    [0.866025, 0.0, 0.0, 0.5]
    """
    p, q = np.asarray(a, float), np.asarray(b, float)
    share = np.asarray(s, float)[..., None]
    q = np.where(np.sum(p * q, axis=-1, keepdims=True) < 0, -q, q)
    # the angle by its tangent: the arc cosine has no digits left near zero
    apart = np.linalg.norm(p - q, axis=-1, keepdims=True)
    along = np.linalg.norm(p + q, axis=-1, keepdims=True)
    w = 2 * np.arctan2(apart, along)
    near = w < 1e-8
    safe = np.where(near, 1.0, np.sin(w))
    first = np.where(near, 1 - share, np.sin((1 - share) * w) / safe)
    second = np.where(near, share, np.sin(share * w) / safe)
    return np.asarray(first * p + second * q)
