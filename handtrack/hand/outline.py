"""The outline of the hand in the image, for people to look at.

The capsules' image patches are united as a raster of at most :data:`RASTER_PX` and traced; a left
hand is drawn as what it is tracked as, the mirror image of a right one.

>>> from handtrack.hand.shape import HandShape
>>> from handtrack.hand.surface import Capsules
>>> camera = Camera.assumed_for(640, 480)
>>> pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 90.0, 500.0]))
>>> [outline] = outline_px(np.zeros(20), pose, "right", Capsules(HandShape.default()), camera)
>>> bool(outline[:, 1].min() < camera.project(pose @ np.array([0.0, 180.0, 0.0]))[1])
True
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.hand.surface import Surface
from handtrack.records import Pose

Array = NDArray[np.float64]

#: Longer side of the raster in which the patches are united.
RASTER_PX = 360
_MIRROR = np.array([-1.0, 1.0, 1.0])
_SUBPIXEL_BITS = 4


def outline_px(
    theta: Array, pose: Pose, side: str, surface: Surface, camera: Camera
) -> list[Array]:
    """Closed polygons ``(n_i, 2)`` in pixels of the frame; none where the hand is not known.

    Parameters
    ----------
    theta : (20,)
        Angles in radians.
    pose : Pose
        Palm to camera, of the hand as filmed.
    side : str
        ``"right"`` or ``"left"``.
    surface : Surface
        Of the right-hand model.
    camera : Camera
        Of the clip as filmed.
    """
    if not (np.isfinite(theta).all() and np.isfinite(pose.R).all() and pose.t_mm[2] > 0):
        return []
    left = side == "left"
    seen_by = camera.mirrored() if left else camera
    if left:
        pose = Pose(pose.R * np.outer(_MIRROR, _MIRROR), pose.t_mm * _MIRROR)
    intrinsics = np.array([seen_by.fx_px, seen_by.fy_px, seen_by.cx_px, seen_by.cy_px])
    corners = surface.patches(np.asarray(theta)[None], pose, intrinsics).corners[0]
    polygons = _united(corners)
    if left:
        polygons = [(camera.width_px - 1, 0) + polygon * (-1, 1) for polygon in polygons]
    return polygons


def _united(corners: Array) -> list[Array]:
    """Outlines of the union of convex polygons ``(P, V, 2)``."""
    low, high = corners.min(axis=(0, 1)) - 2, corners.max(axis=(0, 1)) + 2
    scale = min(2.0, RASTER_PX / float(np.max(high - low)))
    width, height = np.ceil((high - low) * scale).astype(int) + 1
    raster = np.zeros((height, width), np.uint8)
    fixed = np.round((corners - low) * scale * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    for polygon in fixed:
        cv2.fillConvexPoly(raster, polygon, 1, cv2.LINE_8, _SUBPIXEL_BITS)
    traced, _ = cv2.findContours(raster, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    return [_without_stairs(line[:, 0, :]) / scale + low for line in traced if len(line) > 8]


def _without_stairs(line: NDArray[Any]) -> Array:
    """Every second point of a traced line, after the mean over seven neighbours."""
    around = np.concatenate([line[-3:], line, line[:3]]).astype(float)
    return np.mean([around[k : k + len(line)] for k in range(7)], axis=0)[::2]
