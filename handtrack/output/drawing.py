"""The hand drawn over its frame, so that a person sees at once whether it fits.

The model's outline is a thin light line with a dark rim; bones and joints have a colour for each
digit (Okabe and Ito's, told apart by colour-blind eyes too); a predicted hand is drawn thin. The
bar on top says status, side and time.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import KEYPOINT_PARENTS, N_KEYPOINTS
from handtrack.records import Array, FrameResult, Status

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

DIGIT_COLOURS: tuple[Colour, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 190, 130),
    (240, 228, 66),
    (224, 121, 187),
)
STATUS_COLOURS: dict[Status, Colour] = {
    Status.TRACKED: (0, 158, 115),
    Status.PREDICTED: (200, 130, 0),
    Status.LOST: (190, 40, 40),
    Status.UNDECODABLE: (90, 90, 90),
}
_WHITE, _DARK = (255, 255, 255), (20, 20, 20)
_SUBPIXEL_BITS = 3


def draw_result(
    image: Image, result: FrameResult, outline_px: Sequence[Array] = (), label: str = ""
) -> None:
    """Draw onto ``image`` ``(H, W, 3)`` in place: outline ``(n_i, 2)``, bones, status, time."""
    scale = max(1.0, min(image.shape[:2]) / 400)
    draw_outline(image, outline_px, scale)
    if np.isfinite(result.keypoints_px).all():
        firm = result.status is Status.TRACKED
        draw_bones(image, result.keypoints_px, scale if firm else 0.5 * scale)
    draw_bar(image, result, label)


def draw_outline(image: Image, outline_px: Sequence[Array], scale: float = 1.0) -> None:
    """Polygons ``(n_i, 2)`` as a light line with a dark rim."""
    polygons = [_fixed(p) for p in outline_px if len(p) > 1 and np.isfinite(p).all()]
    for colour, width in ((_DARK, 3.0), (_WHITE, 1.0)):
        thickness = max(1, round(width * scale))
        cv2.polylines(image, polygons, True, colour, thickness, cv2.LINE_8, _SUBPIXEL_BITS)


def draw_bones(image: Image, keypoints_px: Array, scale: float = 1.0) -> None:
    """The skeleton of ``keypoints_px`` ``(21, 2)``; the wrist's spokes are drawn first."""
    points = _fixed(keypoints_px)
    order = sorted(range(1, N_KEYPOINTS), key=lambda k: KEYPOINT_PARENTS[k] != 0)
    thickness = max(1, round(2.5 * scale))
    for k in order:
        a, b = points[KEYPOINT_PARENTS[k]].tolist(), points[k].tolist()
        colour = DIGIT_COLOURS[(k - 1) // 4]
        thin = max(1, thickness // 2) if KEYPOINT_PARENTS[k] == 0 else thickness
        cv2.line(image, a, b, colour, thin, cv2.LINE_AA, _SUBPIXEL_BITS)
    radius = round(2.5 * scale * (1 << _SUBPIXEL_BITS))
    for k in range(N_KEYPOINTS):
        colour = DIGIT_COLOURS[(k - 1) // 4] if k else _WHITE
        centre = points[k].tolist()
        cv2.circle(image, centre, radius + 8, _DARK, -1, cv2.LINE_8, _SUBPIXEL_BITS)
        cv2.circle(image, centre, radius, colour, -1, cv2.LINE_8, _SUBPIXEL_BITS)


def draw_bar(image: Image, result: FrameResult, label: str = "") -> None:
    """Status, side, time and frame number on a bar of the status' colour."""
    height, width = image.shape[:2]
    words = [result.status.value, result.side, f"{result.time_s:.2f} s", f"#{result.index}", label]
    text = "  ".join(word for word in words if word)
    size = float(np.clip(width / 900, 0.35, 1.6))
    (text_width, text_height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    size *= min(1.0, 0.96 * width / max(1, text_width))
    bar = min(height, round(text_height * 1.9))
    image[:bar] = STATUS_COLOURS[result.status]
    cv2.putText(
        image,
        text,
        (round(0.02 * width), round(bar * 0.74)),
        cv2.FONT_HERSHEY_SIMPLEX,
        size,
        _WHITE,
        max(1, round(1.4 * size)),
        cv2.LINE_AA,
    )


def _fixed(points_px: Array) -> NDArray[np.int32]:
    """Points in OpenCV's fixed point; far outside they are cut off, not wrapped round."""
    near = np.clip(np.asarray(points_px, float), -8000, 24000)
    return np.round(near * (1 << _SUBPIXEL_BITS)).astype(np.int32)
