"""Hands that others modelled: a mesh, its joints, and how much of each bone is in a vertex.

They bend about their own joints, which lie where their makers put them, so what they are asked to
do and what they do then differ; :func:`angles_of` says the latter.
"""

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.hand.shape import HandShape
from synth.surface import Mesh

Array = NDArray[np.float64]

#: Of the weights' columns, the first of a digit's: the arm's and the palm's come before.
FIRST_DIGIT = 2


class Arm:
    """A right hand with its forearm, in its palm's frame, of the size of the default hand.

    Attributes
    ----------
    mesh : Mesh
        With the wrist at the origin, fingers along y, the palm towards z.
    weights : (n, 17)
        Of the arm, the palm and the 15 bones of the digits.
    joints_mm : (5, 4, 3)
        First joint, the two others and the tip of every digit.
    """

    def __init__(self, mesh: Mesh, weights: Array, wrist: Array, joints_mm: Array) -> None:
        y = unit(joints_mm[2, 0] - wrist)
        z = unit(np.cross(joints_mm[1, 0] - joints_mm[4, 0], y))
        R = np.stack([np.cross(y, z), y, z])
        default = HandShape.default()
        length = np.linalg.norm(np.diff(joints_mm[2], axis=0), axis=1).sum()
        length += np.linalg.norm(joints_mm[2, 0] - wrist)
        factor = (default.palm_length_mm + default.length_mm[2].sum()) / length
        self.mesh = Mesh((mesh.vertices - wrist) @ R.T * factor, mesh.faces)
        self.weights = weights
        self.joints_mm = (joints_mm - wrist) @ R.T * factor
        bones = unit(np.diff(self.joints_mm, axis=1))
        self._hinges = np.stack([_hinge(bones[d], self.joints_mm, d) for d in range(5)])
        self._at_rest = angles_of(self.joints_mm).reshape(5, 4)

    def posed(self, theta: Array, wrist: Array) -> tuple[Array, Array]:
        """Vertices ``(n, 3)`` and joints ``(5, 4, 3)``, mm, of a hand about so bent.

        Parameters
        ----------
        theta : (20,)
            Angles about as :mod:`handtrack.hand.skeleton` has them; :func:`angles_of` says exactly
            how the hand is bent then.
        wrist : (2,)
            Turn of the arm about x and z.
        """
        moves = [np.eye(4), np.eye(4)]  # of the arm and of the palm
        moves[0][:3, :3] = rotation.about_z(wrist[1]) @ rotation.about_x(wrist[0])
        joints = self.joints_mm.copy()
        for d, angles in enumerate(theta.reshape(5, 4)):
            so_far = np.eye(4)
            for j, turn in enumerate(self._own_turns(d, angles)):
                own = np.eye(4)
                own[:3, :3], own[:3, 3] = turn, self.joints_mm[d, j] - turn @ self.joints_mm[d, j]
                so_far = so_far @ own
                moves.append(so_far)
                joints[d, j + 1] = so_far[:3, :3] @ self.joints_mm[d, j + 1] + so_far[:3, 3]
        moved = np.tensordot(self.weights, np.array(moves), 1)
        v = self.mesh.vertices
        return np.einsum("vij,vj->vi", moved[:, :3, :3], v) + moved[:, :3, 3], joints

    def _own_turns(self, d: int, angles: Array) -> list[Array]:
        """Rotations ``(3, 3)`` of a digit's three joints."""
        hinge = self._hinges[d]
        first, spread, second, third = angles - self._at_rest[d]
        across = np.array([0.0, 0.0, -1.0])
        if d == 0:
            across = unit(np.cross(self.joints_mm[0, 1] - self.joints_mm[0, 0], hinge))
        base = rotation.exp(spread * across) @ rotation.exp(first * hinge)
        return [base, rotation.exp(second * hinge), rotation.exp(third * hinge)]


def angles_of(joints_mm: Array) -> Array:
    """The 20 angles of the default hand whose bones point as those of ``joints_mm`` ``(5, 4, 3)``.

    Rest frames differ from hand to hand, and what is proposed is read in those of the default one.
    """
    rest = rotation.exp(HandShape.default().rest_rotvec)
    bones = unit(np.diff(joints_mm, axis=1))
    local = np.einsum("dij,dki->dkj", rest, bones)
    spread = np.arctan2(local[:, 0, 0], local[:, 0, 1])
    ahead = np.stack([np.sin(spread), np.cos(spread)], axis=-1)
    bend = np.arctan2(local[..., 2], np.einsum("dkj,dj->dk", local[..., :2], ahead))
    second, third = _wrapped(np.diff(bend, axis=1)).T
    return np.column_stack([bend[:, 0], spread, second, third]).ravel()


def _hinge(bones: Array, joints_mm: Array, digit: int) -> Array:
    """The axis ``(3,)`` about which a digit at rest bends towards the palm."""
    if digit == 0:
        inward = joints_mm[4, 0] / 2 - joints_mm[0, 0]
        return unit(np.cross(bones[0], inward))
    return unit(unit(np.cross(bones, [0.0, 0.0, 1.0])).sum(axis=0))


def unit(vectors: Array) -> Array:
    """Of length 1, along the last axis."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _wrapped(angles: Array) -> Array:
    return np.asarray(np.mod(angles + np.pi, 2 * np.pi) - np.pi)
