"""The palm's outline as points with outward normals: what ICP matches to the image's edges.

Samples are spread evenly along the polygon of :class:`~handtrack.hand.shape.HandShape`. Where a
finger leaves the palm, or where the wrist goes on into the forearm, the image has no edge: those
samples are left out.

>>> from handtrack.hand.shape import HandShape
>>> points, normals = palm_outline(HandShape.default())
>>> points.shape == normals.shape and len(points) > 25
True
>>> bool((np.sum((points - points.mean(axis=0)) * normals, axis=1) > 0).all())  # outwards
True

An :class:`Outline` is projected with its normals: the image's tangent is the projected tangent,
and the normal is across it, on the side to which the normal itself projects.
"""

from dataclasses import dataclass, field

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]

#: Samples within this many joint radii of a finger's bones are hidden by the finger.
COVERED = 1.05


def palm_outline(
    shape: HandShape, theta: ArrayLike | None = None, spacing_mm: float = 3.0
) -> tuple[Array, Array]:
    """Points and outward unit normals ``(n, 3)`` of the palm's outline, in its plane.

    Parameters
    ----------
    shape : HandShape
    theta : (20,), optional
        Angles of the fingers, which hide the outline where they lie over it; the flat hand if
        left out.
    spacing_mm : float
        Distance of the samples.
    """
    polygon = shape.palm_outline_mm
    points, tangents = _walk(polygon, spacing_mm)  # without the closing side, across the wrist
    outward = np.column_stack([tangents[:, 1], -tangents[:, 0]])
    if _signed_area(polygon) < 0:
        outward = -outward
    angles = np.zeros(20) if theta is None else np.asarray(theta, float)
    open_side = ~_covered(points, shape, angles) & (points[:, 1] > 0)
    lift = np.zeros((int(open_side.sum()), 1))
    return np.hstack([points[open_side], lift]), np.hstack([outward[open_side], lift])


def _walk(polygon: Array, spacing: float) -> tuple[Array, Array]:
    """Evenly spaced points and unit tangents ``(n, 2)`` along an open polygon."""
    sides = np.diff(polygon, axis=0)
    length = np.linalg.norm(sides, axis=1)
    ends = np.concatenate([[0], np.cumsum(length)])
    n = max(int(ends[-1] / spacing), 1)
    along = (np.arange(n) + 0.5) * ends[-1] / n
    side = np.searchsorted(ends, along, side="right") - 1
    share = (along - ends[side]) / length[side]
    return polygon[side] + share[:, None] * sides[side], sides[side] / length[side, None]


def _signed_area(polygon: Array) -> float:
    """Positive for an outline that turns from x to y."""
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def _covered(points: Array, shape: HandShape, theta: Array) -> NDArray[np.bool_]:
    """Whether points ``(n, 2)`` lie over a bone, seen along the palm's normal."""
    joints = keypoints_mm(theta, shape)[1:, :2].reshape(5, 4, 2)
    a, b = joints[:, :-1].reshape(-1, 2), joints[:, 1:].reshape(-1, 2)
    radius = shape.radius_mm[:, :-1].reshape(-1)
    along = np.sum((points[:, None] - a) * (b - a), axis=-1)
    share = (along / np.maximum(np.sum((b - a) ** 2, axis=-1), 1e-9)).clip(0, 1)
    gap = np.linalg.norm(points[:, None] - a - share[..., None] * (b - a), axis=-1)
    return np.asarray((gap < COVERED * radius).any(axis=1))


@dataclass(frozen=True, eq=False)
class Outline:
    """Points and outward unit normals ``(n, 3)``, and unit tangents of the outline there.

    Without tangents the points are in the palm's plane, and tangents are ``z`` cross normal.

    Raises
    ------
    InputError
        The shapes are not ``(n, 3)`` twice, or a value is not finite.
    """

    points_mm: Array
    normals: Array
    tangents: Array | None = None
    centre_mm: Array = field(init=False)  # (3,) mean of the points

    def __post_init__(self) -> None:
        if self.tangents is None:
            x, y = np.asarray(self.normals, float).T[:2]
            object.__setattr__(self, "tangents", np.column_stack([-y, x, 0 * x]))
        for name in ("points_mm", "normals", "tangents"):
            array = np.ascontiguousarray(getattr(self, name), float)
            object.__setattr__(self, name, array)
            if array.ndim != 2 or array.shape[1] != 3 or len(array) != len(self.points_mm):
                raise InputError(f"outline: {name} has shape {array.shape}, wanted (n, 3)")
            if not np.isfinite(array).all():
                raise InputError(f"outline: {name} has values that are not finite")
        if len(self.points_mm) == 0:
            raise InputError("outline: no points")
        object.__setattr__(self, "centre_mm", self.points_mm.mean(axis=0))
        freeze_arrays(self)

    def seen(
        self, pose: Pose, camera: Camera, orthographic: bool = False
    ) -> tuple[Array, Array] | None:
        """Pixels and unit image normals ``(n, 2)``; None where a point is behind the camera.

        ``orthographic`` puts all points at the depth of their centre. A side seen end-on has the
        normal zero, and matches nothing.
        """
        K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
        pixels, normals = np.empty((len(self.points_mm), 2)), np.empty((len(self.points_mm), 2))
        depth = float((pose @ self.centre_mm)[2]) if orthographic else 0.0
        args = (pose.R, pose.t_mm, self.points_mm, self.normals, self.tangents, K, depth)
        in_front = _project_outline(*args, pixels, normals)
        return (pixels, normals) if in_front and (depth > 0 or not orthographic) else None


@numba.njit(cache=True)
def _project_outline(R, t, points, normals, tangents, K, depth, pixels, out):  # type: ignore[no-untyped-def]
    """Fill pixels and image normals; ``depth`` above zero is everybody's. False if behind."""
    X, N, T = np.empty(3), np.empty(3), np.empty(3)
    flat = depth > 0
    for n in range(len(points)):
        p, m, s = points[n], normals[n], tangents[n]
        for i in range(3):
            X[i] = R[i, 0] * p[0] + R[i, 1] * p[1] + R[i, 2] * p[2] + t[i]
            N[i] = R[i, 0] * m[0] + R[i, 1] * m[1] + R[i, 2] * m[2]
            T[i] = R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]
        Z = depth if flat else X[2]
        if not Z > 0:
            return False
        x, y = X[0] / Z, X[1] / Z
        pixels[n, 0], pixels[n, 1] = K[0] * x + K[2], K[1] * y + K[3]
        lean_t, lean_n = (0.0, 0.0) if flat else (T[2], N[2])
        tx, ty = K[0] * (T[0] - x * lean_t), K[1] * (T[1] - y * lean_t)
        nx, ny = K[0] * (N[0] - x * lean_n), K[1] * (N[1] - y * lean_n)
        size = np.hypot(tx, ty)
        side = -np.sign(tx * ny - ty * nx) if size > 1e-9 else 0.0
        out[n, 0], out[n, 1] = side * ty / max(size, 1e-9), -side * tx / max(size, 1e-9)
    return True
