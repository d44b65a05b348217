"""What refinement sees of one frame, as flat arrays for the kernels.

The image contour comes thinned to one point every few pixels. Points below the wrist (the forearm,
a sleeve) and on the border of the frame carry weight zero: the forearm must neither pull the palm
nor count against it (design: "stop the evidence there").
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.evidence.evidence import Evidence
from handtrack.records import Pose

Array = NDArray[np.float64]
#: Contour points so near the frame's border are where the frame ends, not the hand.
BORDER_PX = 2.0


@dataclass(frozen=True, eq=False)
class View:
    """The evidence of one crop in the pixels of its window.

    Parameters
    ----------
    contour, normal : (m, 2)
        Points on the silhouette's outline and their outward normals.
    inner : (k, 5)
        Edges inside the silhouette: x, y, unit normal from bright to dark, strength.
    sdf : (h, w)
        Signed distance in px to the outline, negative inside.
    edge_strength, edge_x, edge_y : (h, w)
        Edge strength 0 to 1 and its unit direction, from bright to dark.
    intrinsics : (4,)
        ``fx, fy, cx, cy`` of the window.
    valid : (4,)
        ``x0, y0, x1, y1`` of the window's pixels that lie inside the frame.
    grey : (h, w)
        Brightness.
    doubt : float
        Factor, 1 or more, on the deviations of what is seen: an outline that is half a guess.
    """

    contour: NDArray[np.float64]
    normal: NDArray[np.float64]
    inner: Array
    sdf: NDArray[np.float32]
    edge_strength: NDArray[np.float32]
    edge_x: NDArray[np.float32]
    edge_y: NDArray[np.float32]
    intrinsics: Array
    valid: Array
    grey: NDArray[np.uint8]
    doubt: float = 1.0

    @classmethod
    def of(cls, evidence: Evidence, points: int = 170, doubt: float = 1.0) -> "View":
        """The view of an :class:`Evidence`, its contour thinned to about ``points``."""
        step = max(1, round(len(evidence.contour) / points))
        camera = evidence.camera
        visible = evidence.visible
        y, x = np.flatnonzero(visible.any(axis=1)), np.flatnonzero(visible.any(axis=0))
        grey = np.asarray(cv2.cvtColor(evidence.image, cv2.COLOR_RGB2GRAY), np.uint8)
        darker = towards_dark(grey)
        along = evidence.edge_x * darker[0] + evidence.edge_y * darker[1]
        sign = np.where(along < 0, -1, 1).astype(np.float32)
        empty = len(x) == 0
        return cls(
            contour=evidence.contour[::step].astype(float),
            normal=evidence.contour_normal[::step].astype(float),
            inner=inner_edges(evidence, darker),
            sdf=np.array(evidence.sdf),
            edge_strength=np.array(evidence.edge_strength),
            edge_x=evidence.edge_x * sign,
            edge_y=evidence.edge_y * sign,
            intrinsics=np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]),
            valid=np.array([0, 0, 0, 0] if empty else [x[0], y[0], x[-1] + 1, y[-1] + 1], float),
            grey=grey,
            doubt=doubt,
        )

    def wrist_line(self, pose: Pose, wrist_y_mm: float) -> tuple[Array, Array]:
        """A point of the wrist line in px, and the unit direction from it into the hand.

        The line runs through the palm's point ``(0, wrist_y, 0)`` across its y axis.
        """
        fx, fy, cx, cy = self.intrinsics
        ends = pose @ np.array([[0.0, wrist_y_mm, 0.0], [0.0, wrist_y_mm + 20.0, 0.0]])
        a, b = ends[:, :2] / np.maximum(ends[:, 2:], 1.0) * (fx, fy) + (cx, cy)
        return a, (b - a) / max(float(np.linalg.norm(b - a)), 1e-6)

    def above_wrist(self, points: Array, pose: Pose, wrist_y_mm: float) -> NDArray[np.bool_]:
        """Which points ``(m, 2)`` lie on the hand's side of the wrist line."""
        a, axis = self.wrist_line(pose, wrist_y_mm)
        return np.asarray((points - a) @ axis > 0)

    @cached_property
    def outline(self) -> Array:
        """The contour as the kernels take it ``(m, 5)``: x, y, normal, weight, 0 at the border."""
        x0, y0, x1, y1 = self.valid
        x, y = self.contour.T
        inside = (x > x0 + BORDER_PX) & (x < x1 - BORDER_PX)
        inside &= (y > y0 + BORDER_PX) & (y < y1 - BORDER_PX)
        return np.column_stack([self.contour, self.normal, inside])

    @cached_property
    def discs(self) -> list[tuple[Array, float]]:
        """Centres and radii in px of the largest discs in the silhouette, up to three, apart."""
        inside = np.maximum(-self.sdf, 0)
        found: list[tuple[Array, float]] = []
        for _ in range(3):
            _, radius, _, (x, y) = cv2.minMaxLoc(inside)
            if radius < 4 or (found and radius < 0.6 * found[0][1]):
                break
            found.append((np.array([x, y], float), float(radius)))
            cv2.circle(inside, (x, y), int(1.3 * radius), 0.0, -1)
        return found

    @property
    def maps(self) -> tuple[NDArray, ...]:
        """The pictures that the kernels take."""
        return self.sdf, self.edge_strength, self.edge_x, self.edge_y, self.valid

    def weighted(self, points: Array, pose: Pose, wrist_y_mm: float) -> Array:
        """Image points ``(m, 5)`` (x, y, normal, weight), their weight 0 below the wrist line."""
        return np.asarray(
            weighted_kernel(points, pose.R, pose.t_mm, self.intrinsics, float(wrist_y_mm))
        )

    def contour_weights(self, pose: Pose, wrist_y_mm: float) -> Array:
        """Weights ``(m,)``: 0 below the wrist line and at the frame's border, else 1."""
        return self.weighted(self.outline, pose, wrist_y_mm)[:, 4]


@numba.njit(cache=True, nogil=True)
def weighted_kernel(points, R, t, K, wrist_y):  # type: ignore[no-untyped-def]
    """See :meth:`View.weighted`; the line is that of :meth:`View.wrist_line`."""
    ends = np.empty((2, 2))
    for e in range(2):
        y = wrist_y + 20.0 * e
        z = max(R[2, 1] * y + t[2], 1.0)
        ends[e, 0] = (R[0, 1] * y + t[0]) / z * K[0] + K[2]
        ends[e, 1] = (R[1, 1] * y + t[1]) / z * K[1] + K[3]
    axis = ends[1] - ends[0]
    out = points.copy()
    for k in range(len(points)):
        along = (points[k, 0] - ends[0, 0]) * axis[0] + (points[k, 1] - ends[0, 1]) * axis[1]
        if along <= 0.0:
            out[k, 4] = 0.0
    return out


def towards_dark(grey: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Minus the gradient of a brightness ``(h, w)``, x and y alike."""
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (3, 3), 0.8)
    x, y = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    return -x.astype(np.float32, copy=False), -y.astype(np.float32, copy=False)


def inner_edges(
    evidence: Evidence,
    darker: tuple[NDArray[np.float32], NDArray[np.float32]],
    depth_px: float = 4.0,
    most: int = 160,
) -> Array:
    """The strongest edges ``(k, 5)`` at least ``depth_px`` inside the silhouette.

    Their normals point from bright to dark. A finger before the hand is brighter than the crease or
    the shadow behind it, while the far rim of its shadow is an edge the other way round: the sign
    is what tells a finger from the shadow it casts.
    """
    points, normals = evidence.edge_points, evidence.edge_normals
    if len(points) == 0:
        return np.empty((0, 5))
    h, w = evidence.sdf.shape
    x, y = np.clip(points.round().astype(int), 0, (w - 1, h - 1)).T
    strength = evidence.edge_point_strength
    deep = np.flatnonzero(evidence.sdf[y, x] < -depth_px)
    kept = deep[np.argsort(-strength[deep], kind="stable")[:most]]
    x, y, normal = x[kept], y[kept], normals[kept]
    sign = np.where(normal[:, 0] * darker[0][y, x] + normal[:, 1] * darker[1][y, x] < 0, -1, 1)
    return np.column_stack([points[kept], normal * sign[:, None], strength[kept]]).astype(float)
