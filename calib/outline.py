"""The palm's outline and the wrist's width, from the outline in the picture.

The outline is carried back on to the palm's plane ``z = 0`` by the fitted pose. The little
finger's edge and the wrist are read off it; the thumb hides its own edge, which keeps the
default's form at the observed width of the knuckles.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.landmarks import Landmarks
from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from handtrack.records import Pose

Array = NDArray[np.float64]
#: How far the palm reaches beyond each knuckle, in proximal bones.
KNUCKLE_SHARE = 0.28


def on_palm_mm(points_px: Array, pose: Pose, camera: Camera) -> Array:
    """Palm-plane ``x, y`` ``(n, 2)`` of pixels ``(n, 2)``."""
    ray = (points_px - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    ray = np.column_stack([ray, np.ones(len(ray))]) @ pose.R  # in palm axes
    origin = -pose.R.T @ pose.t_mm
    return np.asarray((origin - origin[2] / ray[:, 2:] * ray)[:, :2])


def palm_from_outline(
    shape: HandShape, pose: Pose, landmarks: Landmarks, camera: Camera
) -> HandShape:
    """``shape`` with the observed palm outline and wrist."""
    outline = on_palm_mm(landmarks.contour_px, pose, camera)
    thumb_side = outline[: landmarks.tip_index[0]]
    little_side = outline[landmarks.tip_index[4] :]
    base, default = shape.base_mm[:, :2], HandShape.default()
    little_y = base[4, 1]
    edge_y = np.array([0.94, 0.75, 0.55, 0.35, 0.12]) * little_y
    edge_x = [_crossing(little_side, y, base[4, 0] - 10.0) for y in edge_y]
    thumb_y = np.array([0.12, 0.3]) * little_y
    thumb_x = [_crossing(thumb_side, y, x) for y, x in zip(thumb_y, (28.0, 33.0), strict=True)]
    right = _crossing(thumb_side, 0.0, shape.wrist_radius_mm)
    left = _crossing(little_side, 0.0, -shape.wrist_radius_mm)
    wrist_radius = float(np.clip((right - left) / 2, 18.0, 36.0))
    middle = float(np.clip((right + left) / 2, -8.0, 8.0))
    widen = base[1, 0] / default.base_mm[1, 0]
    knuckles = base[1:] + KNUCKLE_SHARE * shape.length_mm[1:, :1] * _directions(shape)
    vertices = [
        (middle + wrist_radius, -4.0),
        *zip(np.clip(thumb_x, 16.0, 36.0 * widen), thumb_y, strict=True),
        (35 * widen, 50.0),
        (34 * widen, base[1, 1] - 2.0),
        *knuckles,
        *zip(np.minimum(edge_x, [base[4, 0] - 3.0, *[-16.0] * 4]), edge_y, strict=True),
        (middle - wrist_radius, -4.0),
    ]
    return replace(shape, palm_outline_mm=np.array(vertices), wrist_radius_mm=wrist_radius)


def _directions(shape: HandShape) -> Array:
    """Unit ``x, y`` ``(4, 2)`` of the straight fingers."""
    return np.asarray(rotation.exp(shape.rest_rotvec)[1:, :2, 1])


def _crossing(path: Array, y: float, otherwise: float) -> float:
    """``x`` where ``path`` ``(n, 2)`` crosses the height ``y`` nearest to the digits."""
    below = path[:, 1] < y
    crosses = np.flatnonzero(below[1:] != below[:-1])
    if not len(crosses):
        return otherwise
    x = path[crosses, 0]
    return float(x[np.argmin(np.abs(x - otherwise))])
