"""Skin: how the mesh follows the bones.

17 bones move the skin: the palm, 15 phalanges, the forearm. Weights are smooth functions of where
a vertex lies along its digit in the rest pose; motions are blended as dual quaternions (Kavan et
al. 2008), which turns skin about the joint instead of pulling it through, so that bent fingers
keep their thickness.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth import quaternion as quat
from synth.handspec import HandSpec
from synth.kinematics import bone_frames, forearm_turn
from synth.surface import REST_THETA, Mesh

Array = NDArray[np.float64]
PALM, FOREARM = 0, 16


@dataclass(frozen=True, eq=False)
class Chart:
    """Where each vertex lies in the rest pose: coordinates that weights and paint share."""

    local: Array  # (n, 5, 3) in the frame of each digit's first joint, as if it were straight
    share: Array  # (n, 6) membership of the palm and the five digits, sums to 1

    @classmethod
    def of(cls, mesh: Mesh, hand: HandSpec) -> "Chart":
        """Chart the rest mesh."""
        q, start, end = bone_frames(REST_THETA, hand)
        heads = slice(0, 15, 3)
        offset = mesh.vertices[:, None] - start[heads]
        local = quat.rotate(quat.conjugate(q[heads]), offset)
        return cls(local, _shares(mesh.vertices, local, hand, start, end))


def _smoothstep(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _segment_distance(points: Array, a: Array, b: Array) -> Array:
    along = b - a
    s = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - a - s[:, None] * along, axis=1)


def _shares(vertices: Array, local: Array, hand: HandSpec, start: Array, end: Array) -> Array:
    """Which digit a vertex belongs to, softly: by distance to the axes of the digits."""
    reach = [
        _segment_distance(vertices, start[3 * d], end[3 * d + 2]) - hand.radius_mm[d, 1]
        for d in range(5)
    ]
    fingers = np.stack(reach[1:], axis=1)
    near = np.exp(-(fingers - fingers.min(axis=1, keepdims=True)) / 2.5)
    near /= near.sum(axis=1, keepdims=True)
    rises = _smoothstep((local[:, 1:, 1] + 9.0) / 24.0)  # palm -> first phalanx
    carpal = np.array([10.0, 12.0, 0.0])
    metacarpals = (
        np.stack(
            [
                _segment_distance(vertices, carpal * (1 - 0.5 * (d - 1), 1, 1), hand.base_mm[d])
                for d in range(1, 5)
            ],
            axis=1,
        ).min(axis=1)
        - hand.palm_thickness_mm[1]
    )
    rest = np.minimum(metacarpals, fingers.min(axis=1) - 2.0)
    thumb = 1.0 / (1.0 + np.exp(-(rest - reach[0]) / 4.0))
    thumb *= _smoothstep((local[:, 0, 1] + 10.0) / 26.0)
    digits = np.concatenate([thumb[:, None], (1 - thumb)[:, None] * near * rises], axis=1)
    palm = np.clip(1.0 - digits.sum(axis=1, keepdims=True), 0.0, 1.0)
    return np.concatenate([palm, digits], axis=1)


def weights(chart: Chart, vertices: Array, hand: HandSpec) -> Array:
    """Skin weights ``(n, 17)``; rows sum to 1."""
    W = np.zeros((len(vertices), 17))
    wrist = _smoothstep((vertices[:, 1] + 16.0) / 26.0)
    W[:, PALM] = chart.share[:, 0] * wrist
    W[:, FOREARM] = chart.share[:, 0] * (1 - wrist)
    for d in range(5):
        y = chart.local[:, d, 1]
        L1, L2 = hand.length_mm[d, 0], hand.length_mm[d, :2].sum()
        r1, r2 = 0.75 * hand.radius_mm[d, 1:3]
        second = _smoothstep((y - L1 + r1) / (2 * r1))
        third = _smoothstep((y - L2 + r2) / (2 * r2))
        share = chart.share[:, d + 1]
        W[:, 1 + 3 * d] = share * (1 - second)
        W[:, 2 + 3 * d] = share * (second - third)
        W[:, 3 + 3 * d] = share * third
    return W


class Skin:
    """A mesh bound to its bones; :meth:`pose` moves it."""

    def __init__(self, mesh: Mesh, hand: HandSpec) -> None:
        self.mesh, self.hand = mesh, hand
        self.chart = Chart.of(mesh, hand)
        self.weights = weights(self.chart, mesh.vertices, hand)
        self._rest = bone_frames(REST_THETA, hand)

    def pose(self, theta: ArrayLike, wrist: tuple[float, float] = (0.0, 0.0)) -> Array:
        """Vertices ``(n, 3)`` in the palm frame.

        Parameters
        ----------
        theta : (20,)
            Joint angles in radians.
        wrist : (float, float)
            Turn of the forearm about x and about z at the wrist, radians.
        """
        q, start, _ = bone_frames(theta, self.hand)
        q0, start0, _ = self._rest
        turn = quat.multiply(q, quat.conjugate(q0))
        move = start - quat.rotate(turn, start0)
        arm = forearm_turn(wrist)
        motions = np.concatenate(
            [
                quat.dual([[1.0, 0, 0, 0]], np.zeros((1, 3))),
                quat.dual(turn, move),
                quat.dual(arm[None], np.zeros((1, 3))),
            ]
        )
        return quat.apply_dual(self.weights @ motions, self.mesh.vertices)

    def normals(self, vertices: Array) -> Array:
        """Unit normals ``(n, 3)`` of the mesh with its vertices there."""
        return self.mesh.normals(vertices)
