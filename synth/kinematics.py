"""Forward kinematics with quaternions, written apart from ``handtrack.hand.kinematics``.

Bones are numbered ``3 d + j`` (digit ``d``, joint ``j``). The first joint turns by
``rest Rz(-abduction) Rx(flexion)``, the others by ``Rx(flexion)``, bones lie along y.

>>> import numpy as np
>>> from synth.handspec import HandSpec
>>> hand = HandSpec.named("average")
>>> bool(np.allclose(keypoints_mm(np.zeros(20), hand)[9], hand.base_mm[2]))
True
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth import quaternion as quat
from synth.handspec import HandSpec

Array = NDArray[np.float64]


def bone_frames(theta: ArrayLike, hand: HandSpec) -> tuple[Array, Array, Array]:
    """Pose of every bone in the palm frame.

    Returns
    -------
    q : (..., 15, 4)
        Orientation of each bone.
    start_mm, end_mm : (..., 15, 3)
        Its joint's centre and its far end.
    """
    angles = np.asarray(theta, float).reshape(*np.shape(theta)[:-1], 5, 4)
    first = quat.multiply(quat.turn("z", -angles[..., 1]), quat.turn("x", angles[..., 0]))
    q1 = quat.multiply(hand.rest, first)
    q2 = quat.multiply(q1, quat.turn("x", angles[..., 2]))
    q3 = quat.multiply(q2, quat.turn("x", angles[..., 3]))
    q = np.stack([q1, q2, q3], axis=-2)  # (..., 5, 3, 4)
    along = quat.rotate(q, np.array([0.0, 1.0, 0.0])) * hand.length_mm[..., None]
    end = hand.base_mm[:, None] + np.cumsum(along, axis=-2)
    start = end - along
    lead = angles.shape[:-2]
    return q.reshape(*lead, 15, 4), start.reshape(*lead, 15, 3), end.reshape(*lead, 15, 3)


def forearm_turn(wrist: ArrayLike) -> Array:
    """Quaternion ``(4,)`` of a forearm turned by ``wrist`` ``(2,)`` about x, then z, radians."""
    about_x, about_z = np.asarray(wrist, float)
    return quat.multiply(quat.turn("z", about_z), quat.turn("x", about_x))


def mirror(side: str) -> Array:
    """``S``: what turns the right hand's palm frame into this hand's."""
    return np.array([-1.0 if side == "left" else 1.0, 1.0, 1.0])


class Bending:
    """What actors and models have that bend exactly as they are asked to."""

    def __init__(self, hand: HandSpec) -> None:
        self.hand = hand

    def bent(self, theta: Array) -> tuple[Array, Array]:
        """Keypoints ``(..., 21, 3)``, mm, in the palm's frame, and the angles ``(..., 20)``."""
        return keypoints_mm(theta, self.hand), theta


def keypoints_mm(theta: ArrayLike, hand: HandSpec) -> Array:
    """The 21 keypoints ``(..., 21, 3)`` in the palm frame."""
    _, start, end = bone_frames(theta, hand)
    lead = start.shape[:-2]
    chains = np.concatenate(
        [start.reshape(*lead, 5, 3, 3), end.reshape(*lead, 5, 3, 3)[..., 2:, :]], axis=-2
    )
    return np.concatenate([np.zeros((*lead, 1, 3)), chains.reshape(*lead, 20, 3)], axis=-2)
