"""A wooden doll's hand, of swept spheres and ray cast in software: unlike the smooth one.

Every bone is a ball swept from joint to joint, the palm a fan of such sweeps, and light is a lamp's
diffuse and glossy part (Phong 1975) without shadow, crease or nail. What follows a hand must not
depend on how :mod:`synth.light` shades it or on the flesh of :mod:`synth.surface`; the proposer's
network has seen both, and nothing of this.
"""

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from synth import quaternion as quat
from synth.handspec import HandSpec
from synth.kinematics import Bending, bone_frames, forearm_turn, mirror
from synth.layer import Layer
from synth.scene import Scene
from synth.surface import FOREARM_LENGTH_MM
from synth.tones import TONES, some_cloth

Array = NDArray[np.float64]
#: The forearm's number among the parts; the palm is before it, the bones are the first 15.
ARM = 16
_FINE = 2  # drawn this many times as large, then reduced: smooth rims
_BALLS, _BALLS_OF_ARM = 16, 30
_FAN = np.linspace(0, 1, 9)
_AMBIENT, _GLOSS_POWER = 0.25, 30.0
_STUB_MM = 40.0
_NEAREST_MM = 30.0


class SpheresActor(Bending):
    """Draws the doll's hand; needs no OpenGL."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(HandSpec.named(scene.hand))
        self._camera = scene.camera
        self._S = mirror(scene.side)
        self._arm_mm = _STUB_MM if scene.look.forearm == "stub" else FOREARM_LENGTH_MM
        rng = np.random.default_rng([scene.seed, 9])
        self._girth = np.exp(rng.normal(0.03, 0.06) + rng.normal(0, 0.08, (5, 4)))
        self._tone = np.array(TONES[scene.look.skin]) * np.exp(rng.normal(0, 0.06, (17, 1)))
        self._sleeve = scene.look.forearm == "sleeve"
        if self._sleeve:
            self._tone[ARM] = some_cloth(rng)
        way = rng.normal(size=(int(rng.integers(1, 3)), 3))
        way[:, 1:] = -np.abs(way[:, 1:]) - (0.0, 0.5)  # from above and before the hand
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        self._lamps = np.column_stack([way, rng.uniform(0.3, 0.8, len(way))])
        self._gloss = float(rng.uniform(0, 0.4))

    def __enter__(self) -> "SpheresActor":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held."""

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant."""
        centres, radii, part = balls(theta, self.hand, self._girth, self._arm_mm, wrist)
        seen = (centres * self._S) @ R.T + t_mm
        near = seen[:, 2] > radii + _NEAREST_MM
        c = self._camera
        fine = np.array([c.fx_px, c.fy_px, c.cx_px + 0.5, c.cy_px + 0.5]) * _FINE
        fine[2:] -= 0.5
        canvas = np.zeros((c.height_px * _FINE, c.width_px * _FINE, 5), np.float32)
        depth = np.full(canvas.shape[:2], np.inf, np.float32)
        skin = 255.0 * ((part != ARM) | (not self._sleeve))
        tones = np.column_stack([self._tone[part], skin])[near]
        _cast(seen[near], radii[near], tones, fine, self._lamps, self._gloss, canvas, depth)
        size = (c.width_px, c.height_px)
        drawn = cv2.resize(canvas, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
        return Layer(drawn[..., :4], drawn[..., 4] >= 128)


def balls(
    theta: Array, hand: HandSpec, girth: Array, arm_mm: float, wrist: Array
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Centres ``(n, 3)`` in the palm frame, radii ``(n,)`` in mm and parts ``(n,)``.

    Parts are the 15 bones, the palm (15) and the forearm (`ARM`); ``girth`` ``(5, 4)`` multiplies
    the radii of the digits.
    """
    _, start, end = bone_frames(theta, hand)
    radius = hand.radius_mm * girth
    sweeps = []

    def sweep(a: Array, b: Array, r: tuple[float, float], part: int, n: int = _BALLS) -> None:
        w = np.linspace(0, 1, n)
        sweeps.append((a + w[:, None] * (b - a), r[0] + w * (r[1] - r[0]), np.full(n, part)))

    for bone in range(15):
        d, j = divmod(bone, 3)
        bone_mm = end[bone] - start[bone]
        short = radius[d, 3] / np.linalg.norm(bone_mm) if j == 2 else 0.0  # the tip is on the skin
        sweep(start[bone], end[bone] - short * bone_mm, (radius[d, j], radius[d, j + 1]), bone)
    thick, width = hand.palm_thickness_mm, hand.wrist_mm[0] - hand.palm_thickness_mm[0]
    index, little = hand.base_mm[1], hand.base_mm[4]
    for w in _FAN:
        at_wrist = np.array([width * (1 - 2 * w), 0.0, 0.0])
        sweep(at_wrist, (1 - w) * index + w * little, (thick[0], 0.95 * thick[1]), 15)
    ball = 0.6 * start[0] + 0.4 * end[0]
    sweep(np.array([width, 4.0, 0.0]), ball, (0.75 * hand.thenar_mm, 0.8 * hand.thenar_mm), 15)
    sweep(index, ball, (0.8 * thick[1], radius[0, 1]), 15)
    down = quat.rotate(forearm_turn(wrist), np.array([0.0, -arm_mm, 0.0]))
    share = arm_mm / FOREARM_LENGTH_MM
    thin = hand.wrist_mm[1], hand.wrist_mm[1] + share * (hand.forearm_mm[1] - hand.wrist_mm[1])
    for x in np.linspace(-1, 1, 5):
        at_wrist = np.array([x * (hand.wrist_mm[0] - hand.wrist_mm[1]), 0.0, 0.0])
        wider = x * share * (hand.forearm_mm[0] - hand.forearm_mm[1])
        far = down + (1 - share) * at_wrist + np.array([wider, 0.0, 0.0])
        sweep(at_wrist, far, thin, ARM, _BALLS_OF_ARM)
    centres, radii, parts = zip(*sweeps, strict=True)
    return np.concatenate(centres), np.concatenate(radii), np.concatenate(parts)


@numba.njit(cache=True)
def _cast(centres, radii, tones, K, lamps, gloss, canvas, depth):  # type: ignore[no-untyped-def]
    """Draw balls in the camera frame into premultiplied RGBA and, fifth, how much of it is skin.

    ``tones`` ``(n, 4)`` are sRGB and whether it is; ``depth`` is that of what was drawn.
    """
    fx, fy, cx, cy = K
    height, width = depth.shape
    for i in range(len(radii)):
        x, y, z, r = centres[i, 0], centres[i, 1], centres[i, 2], radii[i]
        reach = 1.03 * fx * r / (z - r) + 1
        u0, v0 = fx * x / z + cx, fy * y / z + cy
        for v in range(max(0, int(v0 - reach)), min(height, int(v0 + reach) + 2)):
            for u in range(max(0, int(u0 - reach)), min(width, int(u0 + reach) + 2)):
                dx, dy = (u - cx) / fx, (v - cy) / fy
                a, b = dx * dx + dy * dy + 1, dx * x + dy * y + z
                inside = b * b - a * (x * x + y * y + z * z - r * r)
                if inside < 0:
                    continue
                t = (b - np.sqrt(inside)) / a
                if t >= depth[v, u]:
                    continue
                depth[v, u] = t
                nx, ny, nz = (dx * t - x) / r, (dy * t - y) / r, (t - z) / r
                diffuse, shine = _AMBIENT, 0.0
                for k in range(len(lamps)):
                    lx, ly, lz, strength = lamps[k]
                    facing = nx * lx + ny * ly + nz * lz
                    if facing > 0:
                        diffuse += strength * facing
                        half = (nx * lx + ny * ly + nz * (lz - 1)) / np.sqrt(2 - 2 * lz)
                        shine += strength * gloss * max(half, 0.0) ** _GLOSS_POWER
                for c in range(3):
                    canvas[v, u, c] = min(255.0, tones[i, c] * diffuse + 255 * shine)
                canvas[v, u, 3], canvas[v, u, 4] = 255.0, tones[i, 3]
