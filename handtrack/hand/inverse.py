"""Inverse kinematics in closed form: the 20 angles of 21 measured keypoints.

The three bones of a digit lie in one plane, which abduction ``a`` turns about the rest frame's z;
flexion turns within it (:mod:`handtrack.hand.kinematics`). So with ``v_b`` the directions of the
bones in the digit's rest frame, the plane's normal ``n = (cos a, -sin a, 0)`` minimises

    sum_b (n . v_b)^2 + damping mean_b(v_bz^2)^4 sin^2 a

which is the smaller eigenvector of a 2 by 2 matrix, and the angle of ``v_b`` in that plane is the
sum of the flexions up to bone ``b``. What is left, the angle by which bones leave the plane, says
how well the digit's axes fit the hand that was measured. A straight finger that points out of the
palm shows nothing of its abduction; the damping, which grows with ``v_z``, then calls it zero.

>>> import numpy as np
>>> from handtrack.hand.kinematics import keypoints_mm
>>> from handtrack.hand.shape import HandShape
>>> shape, theta = HandShape.default(), np.full((1, 20), 0.2)
>>> found, out_of_plane = angles_of_keypoints(keypoints_mm(theta, shape), shape)
>>> bool(np.allclose(found, theta)), bool(out_of_plane.max() < 1e-6)
(True, True)
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.hand.shape import HandShape

Array = NDArray[np.float64]


def angles_of_keypoints(
    points_mm: ArrayLike, shape: HandShape, damping: float = 0.0
) -> tuple[Array, Array]:
    """Angles ``(..., 20)`` of palm-frame keypoints ``(..., 21, 3)`` of a right hand.

    Returns
    -------
    theta : (..., 20) in radians, abductions within half pi of zero; NaN for a digit that is not
        known or has a bone without length.
    out_of_plane : (..., 5) root mean square angle in radians between a digit's bones and its plane.
    """
    digits = np.asarray(points_mm, float)[..., 1:, :]
    bones = np.diff(digits.reshape(*digits.shape[:-2], 5, 4, 3), axis=-2)
    return angles_of_bones(bones, rotation.exp(shape.rest_rotvec), damping)


def angles_of_bones(bones: ArrayLike, rest: ArrayLike, damping: float = 0.0) -> tuple[Array, Array]:
    """The same from bone vectors ``(..., 5, 3, 3)`` and rest frames ``(5, 3, 3)``."""
    u = np.asarray(bones, float)
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    u = u / np.where(length > 0, length, np.nan)
    v = np.einsum("dki,...dbk->...dbi", np.asarray(rest, float), u)  # (..., 5, 3, 3)
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    xx, xy = (x * x).sum(-1), (x * y).sum(-1)
    yy = (y * y).sum(-1) + damping * (z * z).mean(-1) ** 4
    a = 0.5 * np.arctan2(2 * xy, yy - xx)
    sin, cos = np.sin(a)[..., None], np.cos(a)[..., None]
    turned = np.arctan2(z, x * sin + y * cos)  # (..., 5, 3)
    first = (turned[..., 0] + np.pi / 2) % (2 * np.pi) - np.pi / 2  # -90 to 270 deg
    bends = (np.diff(turned, axis=-1) + np.pi) % (2 * np.pi) - np.pi
    theta = np.concatenate([first[..., None], a[..., None], bends], axis=-1)
    out = np.arcsin(np.clip(x * cos - y * sin, -1, 1))
    return theta.reshape(*theta.shape[:-2], 20), np.sqrt((out**2).mean(-1))
