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
    side = max(shape.wrist_radius_mm - r, 1.0)
    wrist = [palm_node(x, 4.0, 0.0, r) for x in (0.85 * side, 0.3 * side, -0.3 * side, -side)]
    for d in range(1, 5):
        capsules.append((wrist[d - 1], knuckle[d], PALM, -1))
    for d in range(1, 4):
        capsules.append((knuckle[d], knuckle[d + 1], PALM, -1))
    capsules.append((wrist[0], wrist[3], PALM, -2))
    capsules.append((wrist[0], knuckle[0], PALM, -1))
    for x, y in _hypothenar(shape):
        capsules.append((palm_node(x + r, y, 0.0, r), wrist[2], PALM, -1))
    capsules.append((len(nodes) - 1, knuckle[4], PALM, -1))
    # the web between thumb and index: it moves with the thumb's metacarpal
    nodes.append(_Node(1, 2, 0.55, (0.0, 0.0, 0.0), 0.8 * shape.radius_mm[0, 1], 0))
    thumb_web = len(nodes) - 1
    x, y, z = 0.62 * shape.base_mm[1]
    index_web = palm_node(x, y, z, 0.85 * r)
    capsules.append((thumb_web, index_web, 0, 0))
    return nodes, capsules


def _hypothenar(shape: HandShape) -> list[tuple[float, float]]:
    """Points ``x, y`` on the little finger's edge of the palm outline, wrist first."""
    little_y = shape.base_mm[4, 1]
    outline = shape.palm_outline_mm
    closed = np.vstack([outline, outline[:1]])
    edge = []
    for y in (0.35 * little_y, 0.65 * little_y):
        a, b = closed[:-1], closed[1:]
        crosses = (a[:, 1] - y) * (b[:, 1] - y) <= 0
        span = np.where(np.abs(b[:, 1] - a[:, 1]) < 1e-9, 1.0, b[:, 1] - a[:, 1])
        x = a[:, 0] + (y - a[:, 1]) / span * (b[:, 0] - a[:, 0])
        edge.append((float(x[crosses].min()) if crosses.any() else -40.0, float(y)))
    return edge


@numba.njit(cache=True, nogil=True, inline="always")
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
