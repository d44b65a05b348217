"""The paper's cardboard hand, drawn in software: planar patches, painted from far to near.

Each finger is three patches joined at the joints, the palm and a stub of forearm one each
(Section 2, Fig. 1). Patches are flat, lit by the angle to the light, and have a thin dark rim, so
that there are edges to see where one finger lies over another.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from synth import quaternion as quat
from synth.handspec import HandSpec
from synth.kinematics import Bending, bone_frames, forearm_turn, mirror
from synth.layer import Layer
from synth.scene import Scene
from synth.surface import FOREARM_LENGTH_MM
from synth.tones import TONES

Array = NDArray[np.float64]
_FINE = 2  # drawn this many times as large, then reduced: smooth rims
_SHIFT = 4  # bits of sub-pixels in OpenCV's polygons
_LIGHT = np.array([-0.4, -0.5, -0.77])
_TIP_TAPER = 0.7


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat piece, in the palm frame of a right hand or in the camera's."""

    corners: Array  # (v, 3) mm
    shade: float


def palm_outline(hand: HandSpec) -> Array:
    """Outline ``(n, 2)``: the wrist's thumb side, round the knuckles, and back."""
    width = hand.wrist_mm[0]
    index, little = hand.base_mm[1], hand.base_mm[4]
    r1, r4 = hand.radius_mm[1, 0], hand.radius_mm[4, 0]
    over = 0.3 * hand.length_mm[1:, 0].mean()
    knuckles = [(x, y + over) for x, y, _ in hand.base_mm[1:]]
    return np.array(
        [
            (width, -4.0),
            (width + 8.0, 0.3 * index[1]),
            (index[0] + r1 + 1.0, 0.6 * index[1]),
            (index[0] + r1, index[1]),
            *knuckles,
            (little[0] - r4, little[1]),
            (little[0] - r4 + 1.0, 0.5 * little[1]),
            (-width - 1.0, 0.15 * little[1]),
            (-width, -4.0),
        ]
    )


def patches(theta: Array, hand: HandSpec, forearm_mm: float, wrist: Array) -> list[Patch]:
    """All 17 patches of one configuration."""
    _, start, end = bone_frames(theta, hand)
    across = np.repeat(_across(theta, hand), 3, axis=0)
    flat = palm_outline(hand)
    pieces = [Patch(np.column_stack([flat, np.zeros(len(flat))]), 1.0)]
    w0, w1 = hand.wrist_mm[0], hand.wrist_mm[0] + 0.04 * forearm_mm
    stub = np.array([(w0, 0, 0), (-w0, 0, 0), (-w1, -forearm_mm, 0), (w1, -forearm_mm, 0.0)])
    turn = forearm_turn(wrist)
    pieces.append(Patch(quat.rotate(turn, stub), 0.97))
    for bone in range(15):
        d, j = divmod(bone, 3)
        r0, r1 = hand.radius_mm[d, j], hand.radius_mm[d, j + 1] * (_TIP_TAPER if j == 2 else 1.0)
        a, b, x = start[bone], end[bone], across[bone]
        pieces.append(
            Patch(np.array([a - x * r0, b - x * r1, b + x * r1, a + x * r0]), 1 - 0.04 * j)
        )
    return pieces


def _across(theta: Array, hand: HandSpec) -> Array:
    """Unit vectors ``(5, 3)`` across the digits, in the palm's plane: cardboard has no roll."""
    flat = theta.reshape(5, 4) * (0.0, 1.0, 0.0, 0.0)
    q, _, _ = bone_frames(flat.ravel(), hand)
    x = np.cross(quat.rotate(q[::3], np.array([0.0, 1.0, 0.0])), (0.0, 0.0, 1.0))
    return np.asarray(x / np.linalg.norm(x, axis=1, keepdims=True))


class CardboardActor(Bending):
    """Draws the cardboard hand; needs no OpenGL."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(HandSpec.named(scene.hand))
        self._camera = scene.camera
        self._tone = np.array(TONES[scene.look.skin], float)
        self._forearm_mm = 32.0 if scene.look.forearm == "stub" else FOREARM_LENGTH_MM
        self._S = mirror(scene.side)

    def __enter__(self) -> "CardboardActor":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held."""

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant."""
        pieces = patches(theta, self.hand, self._forearm_mm, wrist)
        seen = [Patch((p.corners * self._S) @ R.T + t_mm, p.shade) for p in pieces]
        rgba = painted(seen, self._tone, self._camera)
        return Layer(rgba, rgba[..., 3] >= 128)


def painted(pieces: list[Patch], tone: Array, camera: Camera) -> NDArray[np.uint8]:
    """Patches in the camera frame as premultiplied RGBA ``(h, w, 4)``, of an sRGB tone."""
    canvas = np.zeros((camera.height_px * _FINE, camera.width_px * _FINE, 4), np.uint8)
    for piece in sorted(pieces, key=lambda piece: -piece.corners[:, 2].mean()):
        _paint(canvas, piece, tone, camera)
    size = (camera.width_px, camera.height_px)
    return np.asarray(cv2.resize(canvas, size, interpolation=cv2.INTER_AREA), np.uint8)


def _paint(canvas: NDArray[np.uint8], piece: Patch, tone: Array, camera: Camera) -> None:
    a, b, c = piece.corners[:3]
    normal = np.cross(b - a, c - a)
    facing = abs(normal @ _LIGHT) / max(float(np.linalg.norm(normal)), 1e-9)
    colour = (tone * piece.shade * (0.55 + 0.45 * facing)).clip(0, 255)
    fine = (camera.project(piece.corners) + 0.5) * _FINE - 0.5
    points = [np.round(fine * (1 << _SHIFT)).astype(np.int32)]
    cv2.fillPoly(canvas, points, (*colour.tolist(), 255.0), cv2.LINE_8, _SHIFT)
    rim = (*(0.72 * colour).tolist(), 255.0)
    cv2.polylines(canvas, points, True, rim, _FINE, cv2.LINE_8, _SHIFT)
