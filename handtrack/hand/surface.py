"""Two surfaces behind one interface: what a hand configuration looks like in the image.

Both give, for a batch of configurations under one palm pose, convex image patches with a depth each
and samples on the patches' lateral sides with outward normals. Likelihoods see only that.

``Cardboard`` is the paper's (Section 2, Fig. 1): each finger three connected planar patches, the
palm a planar outline. Seen edge-on it vanishes, its stated weakness. ``Capsules`` gives the hulls
of two circles, right from any direction.

>>> from handtrack.hand.shape import HandShape
>>> pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 50.0, 400.0]))
>>> K = np.array([400.0, 400.0, 128.0, 128.0])
>>> for surface in (Cardboard(HandShape.default()), Capsules(HandShape.default())):
...     seen = surface.patches(np.zeros((3, 20)), pose, K)
...     print(seen.corners.shape[:2], len(seen.sample_patch) == seen.sample.shape[1])
(3, 16) True
(3, 36) True
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handtrack import rotation
from handtrack.hand.capsules import CapsuleHand
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Pose

Array = NDArray[np.float64]
SAMPLES_PER_SIDE = 4
SIDE_T = np.array([0.2, 0.5, 0.8])
ARC_POINTS = 5


@dataclass(frozen=True, eq=False)
class Patches:
    """Image patches of ``n`` configurations: ``P`` convex polygons of ``V`` corners each.

    ``sample_patch`` names the patch a lateral sample lies on, ``digit`` that of a patch (-1 the
    palm), ``bone`` its bone; corners are in order round the patch, repeated where there are fewer.
    """

    corners: Array  # (n, P, V, 2) px
    depth_mm: Array  # (n, P)
    sample: Array  # (n, S, 2) px
    normal: Array  # (n, S, 2) unit
    sample_patch: NDArray[np.intp]  # (S,)
    digit: NDArray[np.intp]  # (P,)
    bone: NDArray[np.intp]  # (P,)


class Surface(Protocol):
    """What can be seen of a hand."""

    def patches(self, theta: Array, pose: Pose, intrinsics: Array) -> Patches:
        """Patches of angles ``(n, 20)`` at one palm pose; ``intrinsics`` is ``fx, fy, cx, cy``."""
        ...


def project(X: Array, intrinsics: Array) -> Array:
    """Pixels ``(..., 2)`` of camera-frame points ``(..., 3)`` mm."""
    fx, fy, cx, cy = intrinsics
    return X[..., :2] / np.maximum(X[..., 2:], 1.0) * (fx, fy) + (cx, cy)


def _along_sides(a: Array, b: Array, middle: Array) -> tuple[Array, Array]:
    """Samples ``(..., k, 2)`` on the segments ``a b`` and normals away from ``middle``."""
    u = (np.arange(SAMPLES_PER_SIDE) + 0.5)[:, None] / SAMPLES_PER_SIDE
    points = a[..., None, :] * (1 - u) + b[..., None, :] * u
    along = b - a
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    outward = np.sign(np.sum(normal * (0.5 * (a + b) - middle), axis=-1, keepdims=True))
    normal = normal * np.where(outward == 0, 1.0, outward)
    return points, np.broadcast_to(normal[..., None, :], points.shape)


class Cardboard:
    """Planar patches; a finger's are as wide as its joints, across the digit in the palm's plane.

    They face as the palm does, the thumb's too: cardboard has no roll.
    """

    def __init__(self, shape: HandShape) -> None:
        self.shape = shape
        hull = shape.palm_outline_mm[ConvexHull(shape.palm_outline_mm).vertices]
        self.palm_mm = np.column_stack([hull, np.zeros(len(hull))])
        self.rest = rotation.exp(shape.rest_rotvec)
        self.digit = np.append(np.repeat(np.arange(5), 3), -1)
        self.bone = np.append(np.tile(np.arange(3), 5), -1)
        sides = np.repeat(np.arange(15), 2 * SAMPLES_PER_SIDE)
        # the palm's wrist side is no outline of a hand: the forearm goes on there
        y = self.palm_mm[:, 1]
        self.open_side = np.minimum(y, np.roll(y, -1)) > 5.0
        n_open = int(self.open_side.sum())
        self.sample_patch = np.append(sides, np.full(n_open * SAMPLES_PER_SIDE, 15))

    def sides_mm(self, theta: Array) -> Array:
        """Both ends ``(n, 5, 4, 2, 3)`` across each joint of angles ``(n, 20)``, palm frame."""
        n = len(theta)
        joints = keypoints_mm(theta, self.shape)[:, 1:].reshape(n, 5, 4, 3)
        sin, cos = np.sin(theta.reshape(n, 5, 4)[..., 1]), np.cos(theta.reshape(n, 5, 4)[..., 1])
        straight = np.stack([sin, cos, np.zeros_like(cos)], axis=-1)  # Rz(-a) y
        straight = np.einsum("dij,ndj->ndi", self.rest, straight)
        across = np.cross(straight, [0.0, 0.0, 1.0])[:, :, None]  # (n, 5, 1, 3)
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        half = self.shape.radius_mm[..., None] * across
        return np.stack([joints + half, joints - half], axis=3)

    def patches(self, theta: Array, pose: Pose, intrinsics: Array) -> Patches:
        """See :class:`Surface`."""
        n, V = len(theta), max(4, len(self.palm_mm))
        X = pose @ self.sides_mm(theta)
        px = project(X, intrinsics)
        a, b = px[:, :, :3], px[:, :, 1:]  # a bone's near and far end
        quads = np.stack([a[..., 0, :], b[..., 0, :], b[..., 1, :], a[..., 1, :]], axis=3)
        quads = quads.reshape(n, 15, 4, 2)
        palm = pose @ self.palm_mm
        palm_px = project(palm, intrinsics)
        corners = np.concatenate([quads, np.repeat(quads[:, :, 3:], V - 4, axis=2)], axis=2)
        palm_px_v = np.concatenate([palm_px, np.repeat(palm_px[-1:], V - len(palm_px), axis=0)])
        corners = np.concatenate([corners, np.broadcast_to(palm_px_v, (n, 1, V, 2))], axis=1)
        z = X[..., 2].mean(axis=3)  # (n, 5, 4)
        depth = (0.5 * (z[:, :, :3] + z[:, :, 1:])).reshape(n, 15)
        depth = np.column_stack([depth, np.full(n, palm[:, 2].mean())])
        middle = quads.mean(axis=2)
        samples = []
        for first, second in ((0, 1), (3, 2)):
            samples.append(_along_sides(quads[:, :, first], quads[:, :, second], middle))
        points, normals = (
            np.stack([s[i] for s in samples], axis=2).reshape(n, -1, 2) for i in range(2)
        )
        edge_a, edge_b = palm_px[self.open_side], np.roll(palm_px, -1, axis=0)[self.open_side]
        on_palm, palm_normal = _along_sides(edge_a, edge_b, palm_px.mean(axis=0))
        points = np.concatenate(
            [points, np.broadcast_to(on_palm.reshape(-1, 2), (n, on_palm.size // 2, 2))], axis=1
        )
        normals = np.concatenate(
            [normals, np.broadcast_to(palm_normal.reshape(-1, 2), (n, on_palm.size // 2, 2))],
            axis=1,
        )
        return Patches(corners, depth, points, normals, self.sample_patch, self.digit, self.bone)


class Capsules:
    """Hulls of two circles: the outline of tapered capsules, whatever their direction."""

    def __init__(self, shape: HandShape) -> None:
        self.hand = CapsuleHand(shape)
        sampled = self.hand.capsule_bone > -2
        self.sides = np.flatnonzero(sampled)
        self.tips = np.flatnonzero(self.hand.capsule_bone == 2)
        self.sample_patch = np.concatenate(
            [np.repeat(self.sides, 2 * len(SIDE_T)), np.repeat(self.tips, ARC_POINTS - 2)]
        )

    def patches(self, theta: Array, pose: Pose, intrinsics: Array) -> Patches:
        """See :class:`Surface`."""
        circles = self.hand.circles_px(theta, pose.R, pose.t_mm, intrinsics)
        first, second = (circles[:, self.hand.capsule_node[:, i]] for i in range(2))
        axis = second[..., :2] - first[..., :2]
        length = np.maximum(np.linalg.norm(axis, axis=-1), 1e-6)
        e = axis / length[..., None]
        # the tangent's normal makes this angle with the axis; past +-1 one disc holds the other
        lean = np.arccos(np.clip((first[..., 2] - second[..., 2]) / length, -1.0, 1.0))
        front = np.linspace(-1, 1, ARC_POINTS) * lean[..., None]
        back = lean[..., None] + np.linspace(0, 1, ARC_POINTS) * 2 * (np.pi - lean[..., None])
        arcs = [_arc(second, e, front), _arc(first, e, back)]
        corners = np.concatenate(arcs, axis=2)
        depth = 0.5 * (first[..., 3] + second[..., 3])
        u = SIDE_T[:, None]
        between = first[:, self.sides, None] * (1 - u) + second[:, self.sides, None] * u
        points, normals = [], []
        for sign in (1.0, -1.0):
            normal = _turn(e, (sign * lean)[..., None])[:, self.sides]  # (n, C, 1, 2)
            points.append(between[..., :2] + between[..., 2:3] * normal)
            normals.append(np.broadcast_to(normal, points[-1].shape))
        n = len(theta)
        tip_angles = front[:, self.tips, 1:-1]
        tip_normal = _turn(e[:, self.tips], tip_angles)
        tip = second[:, self.tips, None]
        points = [np.concatenate(points, axis=2), tip[..., :2] + tip[..., 2:3] * tip_normal]
        normals = [np.concatenate(normals, axis=2), tip_normal]
        sample, normal = (
            np.concatenate([part.reshape(n, -1, 2) for part in parts], axis=1)
            for parts in (points, normals)
        )
        return Patches(
            corners, depth, sample, normal, self.sample_patch,
            self.hand.capsule_digit, self.hand.capsule_bone,
        )  # fmt: skip


def _turn(e: Array, angle: Array) -> Array:
    """Directions ``(..., k, 2)``: ``e`` ``(..., 2)`` turned by ``angle`` ``(..., k)``."""
    c, s = np.cos(angle), np.sin(angle)
    ex, ey = e[..., None, 0], e[..., None, 1]
    return np.stack([c * ex - s * ey, s * ex + c * ey], axis=-1)


def _arc(circle: Array, e: Array, angle: Array) -> Array:
    """Points ``(..., k, 2)`` of circles ``(..., 4)`` at ``angle`` from ``e``."""
    return circle[..., None, :2] + circle[..., None, 2:3] * _turn(e, angle)
