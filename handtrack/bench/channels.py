"""The error of a hand as a skeleton of rotations counts it, beside that of our 20 angles.

A skeleton with a hinge for each joint and three axes for a knuckle holds a hand in 24 channels, and
what is read off them is a rotation vector about the mean rotation, since Euler channels wrap. Three
channels of a knuckle, one of which hardly moves, count for our two: so the mean error is smaller,
and a figure from elsewhere compares only if its channels are the same.

>>> theta = np.zeros((3, 20))
>>> theta[:, 4] = 0.0, 0.1, 0.2  # index finger, MCP
>>> rotation_channels(theta, mean_knuckles(theta))[:, 4:7].round(6).tolist()
[[-0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from handtrack import rotation

Array = NDArray[np.float64]


def rotation_channels(theta: ArrayLike, about: ArrayLike) -> Array:
    """Angles ``(F, 20)`` as ``(F, 24)``: the thumb's four, then each finger's MCP (3), PIP, DIP.

    ``about`` ``(4, 3, 3)`` are the rotations that the MCP's vectors are about.
    """
    angles = np.asarray(theta, float).reshape(-1, 5, 4)
    turn = rotation.log(np.swapaxes(np.asarray(about, float), -1, -2) @ _knuckles(angles))
    fingers = np.concatenate([turn, angles[:, 1:, 2:]], axis=-1)
    return np.hstack([angles[:, 0], fingers.reshape(-1, 20)])


def mean_knuckles(theta: ArrayLike) -> Array:
    """The mean rotation ``(4, 3, 3)`` of each finger's MCP over angles ``(F, 20)``."""
    knuckles = _knuckles(np.asarray(theta, float).reshape(-1, 5, 4))
    return np.array(
        [Rotation.from_matrix(one).mean().as_matrix() for one in knuckles.swapaxes(0, 1)]
    )


def _knuckles(angles: Array) -> Array:
    """``Rz(-abduction) Rx(flexion)`` ``(F, 4, 3, 3)`` of angles ``(F, 5, 4)``."""
    return rotation.about_z(-angles[:, 1:, 1]) @ rotation.about_x(angles[:, 1:, 0])
