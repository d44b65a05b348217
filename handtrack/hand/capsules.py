"""The ``capsule`` surface: a hand of tapered capsules, right from any direction.

A capsule joins two *nodes*, each a sphere. A node is ``(1 - w) K_i + w K_j + offset`` for keypoints
``K``; with ``K_0`` the wrist at the origin this covers joints, fingertips drawn back by their
radius (the last bone ends on the tip's skin), the thumb's web and points of the palm alike. In the
image a sphere is a circle and a capsule the hull of two circles, so the signed distance of a pixel
``p`` to it is::

    d(p) = min over t in [0, 1] of |p - c(t)| - r(t),   c, r linear in t

and by the envelope theorem its derivative needs only ``t*``: this is what makes refinement cheap.

>>> from handtrack.hand.shape import HandShape
>>> hand = CapsuleHand(HandShape.default())
>>> hand.nodes_mm(np.zeros((2, 20))).shape == (2, len(hand.node_radius_mm), 3)
True
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.hand.kinematics import keypoints_kernel
from handtrack.hand.shape import HandShape

Array = NDArray[np.float64]
PALM = -1  # the digit of a capsule that belongs to the palm
#: Sides of the palm outline below this are where the forearm goes on, not an outline.
WRIST_HEIGHT_MM = 12.0


@dataclass(frozen=True)
class _Node:
    """``(1 - w) K_i + w K_j + offset``, a sphere of ``radius`` mm, moving with ``digit``."""

    i: int
    j: int
    w: float
    offset: tuple[float, float, float]
    radius: float
    digit: int


class CapsuleHand:
    """The capsules of one :class:`HandShape`, as flat arrays for the kernels.

    Attributes
    ----------
    node_radius_mm, node_digit : (K,)
        Radius of each node; the digit whose angles move it, or ``PALM``.
    capsule_node : (C, 2)
        The two nodes of each capsule.
    capsule_digit, capsule_bone : (C,)
        The digit and the bone (0 to 2) of each capsule; ``PALM`` and -1 for the palm, -2 for the
        wrist, whose outline is not the hand's.
    """

    def __init__(self, shape: HandShape) -> None:
        self.shape = shape
        self.rest = rotation.exp(shape.rest_rotvec)
        nodes, capsules = _build(shape)
        self.node_from = np.array([(n.i, n.j) for n in nodes])
        self.node_weight = np.array([n.w for n in nodes])
        self.node_offset = np.array([n.offset for n in nodes])
        self.node_radius_mm = np.array([n.radius for n in nodes])
        self.node_digit = np.array([n.digit for n in nodes])
        self.capsule_node = np.array([c[:2] for c in capsules])
        self.capsule_digit = np.array([c[2] for c in capsules])
        self.capsule_bone = np.array([c[3] for c in capsules])

    def nodes_mm(self, theta: Array) -> Array:
        """Node centres ``(n, K, 3)`` in the palm frame of angles ``(n, 20)``."""
        shape = self.shape
        keypoints = np.empty((len(theta), 21, 3))
        keypoints_kernel(
            np.ascontiguousarray(theta), shape.base_mm, self.rest, shape.length_mm, keypoints
        )
        w = self.node_weight[:, None]
        i, j = self.node_from.T
        return (1 - w) * keypoints[:, i] + w * keypoints[:, j] + self.node_offset

    def circles_px(self, theta: Array, R: Array, t_mm: Array, intrinsics: Array) -> Array:
        """Image circles ``(n, K, 4)`` of the nodes: ``x, y, radius`` in px and depth in mm.

        ``R`` and ``t_mm`` are one pose or one each; ``intrinsics`` is ``fx, fy, cx, cy``.
        """
        X = self.nodes_mm(theta) @ np.swapaxes(R, -1, -2) + np.asarray(t_mm)[..., None, :]
        z = np.maximum(X[..., 2], 1.0)
        fx, fy, cx, cy = intrinsics
        return np.stack(
            [fx * X[..., 0] / z + cx, fy * X[..., 1] / z + cy, fx * self.node_radius_mm / z, z],
            axis=-1,
        )


def _build(shape: HandShape) -> tuple[list[_Node], list[tuple[int, int, int, int]]]:
    """Nodes and capsules ``(node, node, digit, bone)`` of a hand."""
    nodes: list[_Node] = []
    capsules: list[tuple[int, int, int, int]] = []

    def palm_node(x: float, y: float, z: float, radius: float) -> int:
        nodes.append(_Node(0, 0, 0.0, (float(x), float(y), float(z)), float(radius), PALM))
        return len(nodes) - 1

    for d in range(5):
        k, first = 1 + 4 * d, len(nodes)
        radius = shape.radius_mm[d]
        end = 1.0 - min(radius[3] / shape.length_mm[d, 2], 0.9)
        nodes.append(_Node(k, k, 0.0, (0.0, 0.0, 0.0), radius[0], PALM))
        nodes.append(_Node(k + 1, k + 1, 0.0, (0.0, 0.0, 0.0), radius[1], d))
        nodes.append(_Node(k + 2, k + 2, 0.0, (0.0, 0.0, 0.0), radius[2], d))
        nodes.append(_Node(k + 2, k + 3, end, (0.0, 0.0, 0.0), radius[3], d))
        capsules += [(first + b, first + b + 1, d, b) for b in range(3)]

    knuckle = [4 * d for d in range(5)]  # node of each digit's first joint
    r = shape.palm_radius_mm
    rim = [palm_node(x, y, 0.0, r) for x, y in _inset(shape.palm_outline_mm, r)]
    height = shape.palm_outline_mm[:, 1]
    for a, b in zip(rim, [*rim[1:], rim[0]], strict=True):
        at_wrist = max(height[a - rim[0]], height[b - rim[0]]) < WRIST_HEIGHT_MM
        capsules.append((a, b, PALM, -2 if at_wrist else -1))
    # the inside of the palm: from the wrist to every knuckle
    wrist = palm_node(0.0, 8.0, 0.0, r)
    capsules += [(wrist, knuckle[d], PALM, -1) for d in range(5)]
    capsules += [(knuckle[d], knuckle[d + 1], PALM, -1) for d in range(1, 4)]
    # the web between thumb and index: it moves with the thumb's metacarpal
    nodes.append(_Node(1, 2, 0.55, (0.0, 0.0, 0.0), 0.8 * shape.radius_mm[0, 1], 0))
    thumb_web = len(nodes) - 1
    x, y, z = 0.62 * shape.base_mm[1]
    capsules.append((thumb_web, palm_node(x, y, z, 0.85 * r), 0, 0))
    return nodes, capsules


def _inset(outline: Array, distance: float) -> Array:
    """An outline ``(n, 2)`` with its corners moved inwards: the palm is a rounded slab.

    A corner moves along its bisector until it is ``distance`` from both its sides, but never past
    the middle.
    """
    ahead = np.roll(outline, -1, axis=0) - outline
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    x, y = outline.T
    anticlockwise = np.sign(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    normal = anticlockwise * np.column_stack([-ahead[:, 1], ahead[:, 0]])  # of the side ahead
    bisector = normal + np.roll(normal, 1, axis=0)
    bisector /= np.maximum(np.linalg.norm(bisector, axis=1, keepdims=True), 1e-9)
    cosine = np.maximum(np.sum(bisector * normal, axis=1, keepdims=True), 0.3)
    to_middle = 0.8 * np.linalg.norm(outline.mean(axis=0) - outline, axis=1, keepdims=True)
    return np.asarray(outline + bisector * np.minimum(distance / cosine, to_middle))


@numba.njit(cache=True, nogil=True, fastmath=True)
def capsule_distance(px, py, ax, ay, ra, bx, by, rb):  # type: ignore[no-untyped-def]
    """Signed distance in px of a point to a 2-D tapered capsule, and ``t*`` of its nearest disc.

    With ``e`` the axis, ``l = |e|`` and ``s = (ra - rb) / l``, the nearest disc lies where the
    perpendicular foot is moved along the axis by ``|perpendicular| s / sqrt(1 - s^2)``.
    """
    ex, ey = bx - ax, by - ay
    qx, qy = px - ax, py - ay
    l2 = ex * ex + ey * ey
    length = np.sqrt(l2)
    if length <= abs(ra - rb) + 1e-9:  # one disc holds the other
        t = 0.0 if ra >= rb else 1.0
    else:
        s = (ra - rb) / length
        foot = (qx * ex + qy * ey) / length
        across = abs(qx * ey - qy * ex) / length
        t = (foot - across * s / np.sqrt(1.0 - s * s)) / length
        t = min(max(t, 0.0), 1.0)
    dx, dy = qx - t * ex, qy - t * ey
    return np.sqrt(dx * dx + dy * dy) - (ra + t * (rb - ra)), t
