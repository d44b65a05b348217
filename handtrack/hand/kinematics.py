"""Forward kinematics of 20 angles, batched, and its Jacobian.

The first joint of digit ``d`` turns by ``R_rest[d] Rz(-abduction) Rx(flexion)``, the two others by
``Rx(flexion)``; bones lie along y. So with ``p`` the first joint's centre and ``L`` the lengths::

    R1 = R_rest Rz(-a) Rx(f0)   R2 = R1 Rx(f1)   R3 = R2 Rx(f2)
    p, p + L1 R1 y, ... + L2 R2 y, ... + L3 R3 y

Everything is in the palm frame of a right hand, mm.

>>> import numpy as np
>>> from handtrack.hand.shape import HandShape
>>> keypoints_mm(np.zeros(20), HandShape.default())[12].round(6).tolist()  # middle tip
[0.0, 189.0, 0.0]
"""

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.hand.shape import HandShape

Array = NDArray[np.float64]


def keypoints_mm(theta: ArrayLike, shape: HandShape) -> Array:
    """The 21 keypoints ``(..., 21, 3)`` in the palm frame of angles ``(..., 20)`` in radians."""
    angles = np.ascontiguousarray(theta, dtype=float)
    points = np.empty((angles.size // 20, 21, 3))
    rest = rotation.exp(shape.rest_rotvec)
    keypoints_kernel(angles.reshape(-1, 20), shape.base_mm, rest, shape.length_mm, points)
    return points.reshape(*angles.shape[:-1], 21, 3)


@numba.njit(cache=True)
def keypoints_kernel(theta, base, rest, length, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` ``(n, 21, 3)`` for ``theta`` ``(n, 20)``; ``rest`` ``(5, 3, 3)``."""
    for n in range(theta.shape[0]):
        out[n, 0, :] = 0.0
        for d in range(5):
            sa, ca = np.sin(theta[n, 4 * d + 1]), np.cos(theta[n, 4 * d + 1])
            k = 1 + 4 * d
            out[n, k, :] = base[d]
            flexion = 0.0
            for j in range(3):
                # all three flexions turn about the same x axis, so they add up
                flexion += theta[n, 4 * d + (0 if j == 0 else j + 1)]
                sf, cf = np.sin(flexion), np.cos(flexion)
                x, y, z = sa * cf, ca * cf, sf  # Rz(-a) Rx(flexion) applied to y
                for i in range(3):
                    step = rest[d, i, 0] * x + rest[d, i, 1] * y + rest[d, i, 2] * z
                    out[n, k + j + 1, i] = out[n, k + j, i] + length[d, j] * step


def keypoint_jacobian(theta: ArrayLike, shape: HandShape) -> tuple[Array, Array]:
    """Keypoints ``(21, 3)`` of one ``theta`` ``(20,)``, and their derivatives ``(21, 3, 20)``."""
    angles = np.asarray(theta, float)
    points = np.zeros((21, 3))
    J = np.zeros((21, 3, 20))
    jacobian_kernel(
        angles, shape.base_mm, rotation.exp(shape.rest_rotvec), shape.length_mm, points, J
    )
    return points, J


@numba.njit(cache=True)
def jacobian_kernel(theta, base, rest, length, points, J):  # type: ignore[no-untyped-def]
    """Fill ``points`` ``(21, 3)`` and ``J`` ``(21, 3, 20)``; ``J`` must come in as zeros."""
    points[0, :] = 0.0
    for d in range(5):
        sa, ca = np.sin(theta[4 * d + 1]), np.cos(theta[4 * d + 1])
        k = 1 + 4 * d
        points[k, :] = base[d]
        flexion = 0.0
        for j in range(3):
            flexion += theta[4 * d + (0 if j == 0 else j + 1)]
            sf, cf = np.sin(flexion), np.cos(flexion)
            L = length[d, j]
            for i in range(3):
                r0, r1, r2 = rest[d, i, 0], rest[d, i, 1], rest[d, i, 2]
                points[k + j + 1, i] = points[k + j, i] + L * (
                    r0 * sa * cf + r1 * ca * cf + r2 * sf
                )
                along_abduction = L * cf * (r0 * ca - r1 * sa)
                along_flexion = L * (-sf * (r0 * sa + r1 * ca) + cf * r2)
                for q in range(4):
                    J[k + j + 1, i, 4 * d + q] = J[k + j, i, 4 * d + q]
                J[k + j + 1, i, 4 * d + 1] += along_abduction
                for m in range(j + 1):
                    J[k + j + 1, i, 4 * d + (0 if m == 0 else m + 1)] += along_flexion
