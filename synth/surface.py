"""The smooth hand in its rest pose: one closed mesh from a blended distance field.

Flesh is a set of rounded cones (spheres swept along a line while their radius changes). Within a
part, and where parts meet, distances are joined by the polynomial smooth minimum ::

    smin(a, b; k) = min(a, b) - max(k - |a - b|, 0)^2 / (4 k)

so that muscles run into one another and the fingers grow out of the palm with webs between them.
The zero level is meshed once per shape by marching cubes, fingers spread so that they do not
fuse; every later pose only moves its vertices (`synth.skin`).
"""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from skimage.measure import marching_cubes

from synth import quaternion as quat
from synth.handspec import HandSpec
from synth.kinematics import bone_frames

Array = NDArray[np.float64]

#: Fingers spread, thumb out: the pose in which the mesh is made.
REST_THETA = np.zeros(20)
REST_THETA[[5, 13, 17]] = np.radians([8, -7, -9])
REST_THETA.setflags(write=False)

FOREARM_LENGTH_MM = 260.0
VOXEL_MM = 2.0
_DIGIT_BLEND_MM = 4.0


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in the palm frame of a right hand."""

    vertices: Array  # (n, 3) mm
    faces: NDArray[np.int32]  # (m, 3), counter-clockwise from outside

    def normals(self, vertices: Array) -> Array:
        """Unit normals ``(n, 3)`` where its vertices are moved, faces weighted by their area."""
        a, b, c = (vertices[self.faces[:, k]] for k in range(3))
        normals = self._corners @ np.cross(b - a, c - a)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    @cached_property
    def _corners(self) -> sparse.csr_matrix:
        """Which faces ``(n, m)`` meet at each vertex."""
        n, m = len(self.vertices), len(self.faces)
        return sparse.csr_matrix(
            (np.ones(3 * m), (self.faces.ravel(), np.repeat(np.arange(m), 3))), shape=(n, m)
        )


class _Flesh:
    """Collects rounded cones, part by part."""

    def __init__(self) -> None:
        self.cones: list[Array] = []
        self.part: list[int] = []
        self.blend: list[tuple[float, float]] = []  # of a part: within it, with those before it

    def begin(self, within_mm: float, join_mm: float) -> None:
        self.blend.append((within_mm, join_mm))

    def cone(self, a: Array, ra: float, b: Array, rb: float) -> None:
        self.cones.append(np.array([*a, ra, *b, rb], float))
        self.part.append(len(self.blend) - 1)


def flesh(hand: HandSpec, forearm_mm: float) -> tuple[Array, NDArray[np.int64], Array]:
    """Rounded cones ``(n, 8)`` of the rest pose, their part ``(n,)``, and blends ``(parts, 2)``."""
    q, start, end = bone_frames(REST_THETA, hand)
    body = _Flesh()
    _palm(body, hand, start, end)
    _thumb_muscles(body, hand, start, end)
    for digit in range(5):
        _digit(body, hand, digit, q, start, end)
    _forearm(body, hand, forearm_mm)
    return np.array(body.cones), np.array(body.part), np.array(body.blend)


def _palm(body: _Flesh, hand: HandSpec, start: Array, end: Array) -> None:
    """Four metacarpals, the ball of the little finger, and the webs."""
    at_wrist, at_knuckle = hand.palm_thickness_mm
    width = hand.wrist_mm[0] - at_wrist
    body.begin(12.0, 8.0)
    for digit in range(1, 5):
        carpal = np.array([width * (1 - 0.65 * (digit - 1)), 6.0, -1.0])
        body.cone(carpal, at_wrist, hand.base_mm[digit] - (0, 0, 1.0), at_knuckle)
    little = hand.base_mm[4]
    h = hand.hypothenar_mm
    body.cone(
        np.array([-width, 14.0, 5.0]), h, np.array([little[0] + 4, 0.72 * little[1], 3.5]), h * 0.8
    )
    for digit in range(1, 5):  # the pad under the knuckles
        first = end[3 * digit] - start[3 * digit]
        pad = start[3 * digit] + 0.12 * first + (0, 0, 3.0)
        body.cone(pad - (0, 14.0, 0.5), at_knuckle * 0.9, pad, at_knuckle * 0.8)
    for digit in range(1, 4):  # webs slope from the knuckles to the palm's side
        a, b = 3 * digit, 3 * digit + 3
        root = (start[a] + start[b]) / 2
        share = hand.web
        edge = (start[a] + start[b]) * (1 - share) / 2 + (end[a] + end[b]) * share / 2
        edge += np.array([0.0, -3.0, 3.0])
        body.cone(root - (0, 0, 1.0), at_knuckle * 0.75, edge, 3.4)


def _thumb_muscles(body: _Flesh, hand: HandSpec, start: Array, end: Array) -> None:
    """The ball of the thumb, and the fold to the index finger."""
    cmc, mcp = start[0], end[0]
    r = hand.thenar_mm
    body.begin(10.0, 9.0)
    ball = cmc + 0.25 * (mcp - cmc) + (-7.0, 0.0, 5.0)
    body.cone(ball, r, cmc + 0.8 * (mcp - cmc) + (-2.0, 0, 2.0), r * 0.68)
    body.cone(np.array([8.0, 24.0, 4.0]), r * 0.85, ball, r * 0.95)
    knuckle = hand.base_mm[1]
    root = 0.55 * knuckle + (2.0, 0, 0)
    body.cone(cmc + 0.62 * (mcp - cmc), 8.5, root, 10.0)
    body.cone(cmc + 0.82 * (mcp - cmc), 6.0, 0.72 * knuckle + (3.0, 0, 0), 8.0)


def _digit(body: _Flesh, hand: HandSpec, digit: int, q: Array, start: Array, end: Array) -> None:
    """Bones that swell at the joints, and the pads of the palm's side.

    Where two cones of a part coincide, blending adds a quarter of its width; the cones are made
    that much thinner, so that the joints have the radii that the hand says.
    """
    radius = hand.radius_mm[digit]
    body.begin(_DIGIT_BLEND_MM, 7.0)
    swell = _DIGIT_BLEND_MM / 4
    for j in range(3):
        bone = 3 * digit + j
        a, b, ra, rb = start[bone], end[bone], radius[j] - swell, radius[j + 1] - swell
        palmar = quat.rotate(q[bone], np.array([0.0, 0.0, 1.0]))
        along = (b - a) / np.linalg.norm(b - a)
        if j == 2:
            rb = radius[3] - 0.3 * swell
            b = b - along * rb  # the tip's skin ends the bone
        middle, rm = (a + b) / 2, (ra + rb) / 2 * 0.97
        body.cone(a, ra, middle, rm)
        body.cone(middle, rm, b, rb)
        pad = palmar * (0.22 * rm)
        body.cone(a + 0.35 * (b - a) + pad, rm * 0.94, a + 0.7 * (b - a) + pad, rm * 0.92)


def _forearm(body: _Flesh, hand: HandSpec, length_mm: float) -> None:
    """Two bones side by side: an oval section that widens towards the elbow."""
    body.begin(14.0, 14.0)
    (w0, h0), (w1, h1) = hand.wrist_mm, hand.forearm_mm
    share = length_mm / 200.0
    w1, h1 = w0 + (w1 - w0) * share, h0 + (h1 - h0) * share
    for side in (-1.0, 1.0):
        a = np.array([side * (w0 - h0), 2.0, -1.0])
        b = np.array([side * (w1 - h1), -length_mm, -1.0])
        body.cone(a, h0 * 0.92, b, h1 * 0.92)
        body.cone(a * (0.3, 1, 1), h0 * 0.9, b * (0.3, 1, 1), h1 * 0.95)


def rest_mesh(
    hand: HandSpec, forearm_mm: float = FOREARM_LENGTH_MM, voxel_mm: float = VOXEL_MM
) -> Mesh:
    """Mesh the hand with a forearm of ``forearm_mm`` beyond the wrist, in steps of ``voxel_mm``."""
    cones, part, blend = flesh(hand, forearm_mm)
    low = np.min(np.minimum(cones[:, :3] - cones[:, 3:4], cones[:, 4:7] - cones[:, 7:]), axis=0)
    high = np.max(np.maximum(cones[:, :3] + cones[:, 3:4], cones[:, 4:7] + cones[:, 7:]), axis=0)
    low, high = low - 4 * voxel_mm, high + 4 * voxel_mm
    size = np.ceil((high - low) / voxel_mm).astype(int) + 1
    field = np.empty(tuple(size), np.float32)
    _fill(field, low, voxel_mm, cones, part, blend)
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(voxel_mm,) * 3)
    return Mesh(vertices.astype(float) + low, faces.astype(np.int32))


@numba.njit(cache=True)
def distance(p, cone):  # type: ignore[no-untyped-def]
    """Signed distance of ``p`` to a rounded cone (Quilez, "Distance functions")."""
    ax, ay, az, r1, bx, by, bz, r2 = cone
    ux, uy, uz = bx - ax, by - ay, bz - az
    px, py, pz = p[0] - ax, p[1] - ay, p[2] - az
    l2 = ux * ux + uy * uy + uz * uz
    if l2 < 1e-9:
        return np.sqrt(px * px + py * py + pz * pz) - max(r1, r2)
    rr = r1 - r2
    a2 = l2 - rr * rr
    il2 = 1.0 / l2
    y = px * ux + py * uy + pz * uz
    z = y - l2
    qx, qy, qz = px * l2 - ux * y, py * l2 - uy * y, pz * l2 - uz * y
    x2 = qx * qx + qy * qy + qz * qz
    y2 = y * y * l2
    z2 = z * z * l2
    k = np.sign(rr) * rr * rr * x2
    if np.sign(z) * a2 * z2 > k:
        return np.sqrt(x2 + z2) * il2 - r2
    if np.sign(y) * a2 * y2 < k:
        return np.sqrt(x2 + y2) * il2 - r1
    return (np.sqrt(x2 * a2 * il2) + y * rr) * il2 - r1


@numba.njit(cache=True)
def _smin(a, b, k):  # type: ignore[no-untyped-def]
    h = max(k - abs(a - b), 0.0)
    return min(a, b) - h * h / (4.0 * k)


@numba.njit(cache=True)
def field_at(p, cones, part, blend):  # type: ignore[no-untyped-def]
    """The blended distance at ``p`` ``(3,)``."""
    total = 1e9
    inner = 1e9
    for i in range(cones.shape[0]):
        inner = _smin(inner, distance(p, cones[i]), blend[part[i], 0])
        if i + 1 == cones.shape[0] or part[i + 1] != part[i]:
            total = _smin(total, inner, blend[part[i], 1])
            inner = 1e9
    return total


@numba.njit(cache=True)
def _fill(field, low, voxel, cones, part, blend):  # type: ignore[no-untyped-def]
    """Sample the field; the distance changes by at most its step, so empty space is skipped."""
    p = np.empty(3)
    for i in range(field.shape[0]):
        p[0] = low[0] + i * voxel
        for j in range(field.shape[1]):
            p[1] = low[1] + j * voxel
            k = 0
            while k < field.shape[2]:
                p[2] = low[2] + k * voxel
                d = field_at(p, cones, part, blend)
                steps = max(1, int((abs(d) - 2.0 * voxel) / voxel))
                for s in range(steps):
                    if k + s < field.shape[2]:
                        field[i, j, k + s] = d
                k += steps
