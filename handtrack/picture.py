"""A frame with the hand drawn over it, as the film and the live page show it."""

from functools import lru_cache

import numpy as np

from handtrack.camera import Camera
from handtrack.evidence.orientation import Image
from handtrack.hand.outline import outline_px
from handtrack.hand.shape import HandShape
from handtrack.hand.surface import Capsules
from handtrack.output.drawing import draw_result
from handtrack.records import Frame, FrameResult, Pose


def drawn(frame: Frame, result: FrameResult, shape: HandShape, camera: Camera) -> Image:
    """The picture of a frame ``(H, W, 3)``; black where the frame could not be decoded."""
    if frame.image is None:
        image = np.zeros((camera.height_px, camera.width_px, 3), np.uint8)
    else:
        image = frame.image.copy()
    pose = Pose(result.R, result.t_mm)
    outline = outline_px(result.theta, pose, result.side, _surface(shape), camera)
    draw_result(image, result, outline)
    return image


@lru_cache(maxsize=2)
def _surface(shape: HandShape) -> Capsules:
    return Capsules(shape)
