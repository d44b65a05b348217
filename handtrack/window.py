"""The crop in which a frame is worked on: where the hand should be, at one size.

Everything measured in window pixels (search lengths, noise, robust scales) then means the same
share of a hand, in a thumbnail as in 4K.
"""

import numpy as np

from handtrack.camera import Camera, Window
from handtrack.hand.shape import HandShape
from handtrack.records import Pose

#: Length of the palm (wrist to middle MCP) in the window, as long as the frame has that many.
PALM_PX = 72.0
#: Half the window's side in palm lengths: the reach of open fingers and some way to move.
HALF_SIDE_PALMS = 1.75
#: Frames smaller than the window are enlarged by no more than this.
MAX_SCALE = 2.0


def window_for(pose: Pose, shape: HandShape, camera: Camera) -> Window:
    """The square window of a hand at ``pose``, of constant size in pixels."""
    middle = pose @ (0.95 * shape.base_mm[2])
    centre = camera.project(middle)
    palm_px = camera.fx_px * shape.palm_length_mm / middle[2]
    scale = min(PALM_PX / palm_px, MAX_SCALE)
    side = 2 * round(HALF_SIDE_PALMS * PALM_PX)
    half = (side - 1) / 2 / scale
    return Window(float(centre[0] - half), float(centre[1] - half), float(scale), side, side)


def shifted_pose(pose: Pose, shift_px: np.ndarray, intrinsics: np.ndarray) -> Pose:
    """``pose`` moved parallel to the image so that it appears ``shift_px`` away."""
    fx, fy = intrinsics[:2]
    z = pose.t_mm[2]
    return Pose(pose.R, pose.t_mm + np.array([shift_px[0] * z / fx, shift_px[1] * z / fy, 0.0]))
