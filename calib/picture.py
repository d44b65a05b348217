"""The picture by which a person confirms a calibration: tips, valleys, wrist, model outline."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.search import FoundHand
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.outline import outline_px
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import DIGITS
from handtrack.hand.surface import Capsules
from handtrack.output.drawing import draw_bones, draw_outline

Image = NDArray[np.uint8]
ENLARGED = 2
_TIP, _VALLEY, _WRIST = (230, 30, 30), (255, 255, 255), (255, 210, 0)
_TEXT_HEIGHT = 22


def confirmation(found: FoundHand, sized: HandShape) -> Image:
    """The hand's window twice as large, RGB: what was found, and the lengths of ``sized``."""
    result = found.result
    picture = found.evidence.image
    if result.side == "left":  # everything in the result is of the mirror image
        picture = picture[:, ::-1]
    size = (picture.shape[1] * ENLARGED, picture.shape[0] * ENLARGED)
    picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC), np.uint8)
    camera = found.evidence.camera
    camera = camera.mirrored() if result.side == "left" else camera
    surface = Capsules(result.shape)
    polygons = outline_px(result.theta, result.pose, "right", surface, camera)
    joints = camera.project(result.pose @ keypoints_mm(result.theta, result.shape))
    draw_outline(picture, [_enlarged(p) for p in polygons], 2.0)
    draw_bones(picture, _enlarged(joints), 1.5)
    marks = result.landmarks
    if marks is not None:
        for points, colour in (
            (marks.tips_px, _TIP),
            (marks.valleys_px, _VALLEY),
            (marks.wrist_px[None], _WRIST),
        ):
            for x, y in np.round(_enlarged(points)).astype(int):
                cv2.circle(picture, (int(x), int(y)), 7, colour, 2, cv2.LINE_AA)
    if result.side == "left":
        picture = np.ascontiguousarray(picture[:, ::-1])
    return _with_text(picture, lines_of(found, sized))


def lines_of(found: FoundHand, sized: HandShape) -> list[str]:
    """What was measured, for the terminal and the picture; ``sized`` is the hand at its size."""
    result = found.result
    lengths = ", ".join(
        f"{digit} {sum(bones):.0f}"
        for digit, bones in zip(DIGITS, sized.length_mm.tolist(), strict=True)
    )
    return [
        f"{result.side} hand, quality {result.quality:.2f}, outline within "
        f"{result.residual_px:.1f} px of the model",
        f"mm: {lengths}; palm {sized.palm_length_mm:.0f}",
    ]


def _enlarged(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((points + 0.5) * ENLARGED - 0.5)


def _with_text(picture: Image, lines: list[str]) -> Image:
    height = _TEXT_HEIGHT * len(lines) + 8
    page = np.full((height + picture.shape[0], picture.shape[1], 3), 255, np.uint8)
    page[height:] = picture
    for k, line in enumerate(lines):
        at = (8, _TEXT_HEIGHT * (k + 1) - 4)
        cv2.putText(page, line, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return page
