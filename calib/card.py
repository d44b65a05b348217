"""Scale from a bank card lying beside the hand: ISO/IEC 7810 ID-1, 85.60 by 53.98 mm.

Outlines of edges with four straight sides and the card's proportions are candidates; each side is
then fitted as a line through the strongest gradients across it, clear of the rounded corners, and
the card's size in pixels is the distance of opposite lines. A card that is tilted against the
picture, or two that disagree, gives no scale.

>>> import numpy as np
>>> picture = np.full((300, 400, 3), 90, np.uint8)
>>> _ = cv2.rectangle(picture, (100, 80), (270, 187), (220, 220, 230), -1)  # 171 x 108 px
>>> card = find_card(picture)
>>> card is not None and abs(card.mm_per_px - 85.6 / 171) < 0.003
True
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.records import freeze_arrays

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

CARD_MM = (85.60, 53.98)
PROPORTION = CARD_MM[0] / CARD_MM[1]
#: What is believed: proportions, opposite sides, and right angles of a card seen frontally.
MAX_PROPORTION_ERROR = 0.04
MAX_TAPER = 0.04
MAX_CORNER_COSINE = 0.07
MIN_LONG_SIDE_PX = 60
MAX_HAND_OVERLAP = 0.05
SEARCH_PX = 5.0
_CLEAR_OF_CORNERS = 0.15  # of a side: the corners are rounded


@dataclass(frozen=True, eq=False)
class Card:
    """A card seen frontally."""

    corners_px: Array  # (4, 2) in order round, from a long side
    mm_per_px: float

    def __post_init__(self) -> None:
        freeze_arrays(self)


def find_card(image: Image, hand: Mask | None = None) -> Card | None:
    """The card in an RGB picture ``(h, w, 3)`` that is not on the ``hand`` ``(h, w)``, if any."""
    found: list[Card] = []
    gradient = _gradient(image)
    for corners in _quadrilaterals(image):
        if _looks_like_card(corners, 2.0) and not _on_hand(corners, hand):
            refined = _refined(corners, gradient)
            if refined is not None and _looks_like_card(refined, 1.0):
                found.append(Card(refined, _mm_per_px(refined)))
    if not found:
        return None
    scales = np.array([card.mm_per_px for card in found])
    best = found[int(np.argmin(np.abs(scales - np.median(scales))))]
    agree = np.abs(scales / best.mm_per_px - 1) < MAX_PROPORTION_ERROR
    return best if agree.mean() > 0.6 else None


def _quadrilaterals(image: Image) -> Iterator[Array]:
    """Corners ``(4, 2)`` of four-sided outlines in the edges of lightness and colour."""
    for channel in cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2Lab)):
        soft = cv2.GaussianBlur(channel, (5, 5), 1.2)
        for low in (12, 30):
            edges = cv2.dilate(cv2.Canny(soft, low, 3 * low), np.ones((3, 3), np.uint8))
            outlines, _ = cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
            for outline in outlines:
                hull = cv2.convexHull(outline)
                length = cv2.arcLength(hull, True)
                if length < 2 * MIN_LONG_SIDE_PX:
                    continue
                quad = cv2.approxPolyDP(hull, 0.03 * length, True)
                filled = cv2.contourArea(outline) > 0.9 * cv2.contourArea(hull)
                if len(quad) == 4 and filled:
                    yield _from_long_side(quad[:, 0].astype(float))


def _from_long_side(corners: Array) -> Array:
    """The same corners, the first side a long one."""
    a, b = np.linalg.norm(corners[:2] - corners[1:3], axis=1)
    return corners if a >= b else np.roll(corners, -1, axis=0)


def _looks_like_card(corners: Array, tolerance: float) -> bool:
    """Proportions, opposite sides and angles, to ``tolerance`` times the limits."""
    sides = np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(sides, axis=1)
    long, short = (length[0] + length[2]) / 2, (length[1] + length[3]) / 2
    if long < MIN_LONG_SIDE_PX or short < 1:
        return False
    unit = sides / length[:, None]
    cosine = np.abs(np.sum(unit * np.roll(unit, -1, axis=0), axis=1)).max()
    taper = max(abs(length[0] - length[2]) / long, abs(length[1] - length[3]) / short)
    return bool(
        abs(long / short / PROPORTION - 1) < tolerance * MAX_PROPORTION_ERROR
        and taper < tolerance * MAX_TAPER
        and cosine < tolerance * MAX_CORNER_COSINE
    )


def _on_hand(corners: Array, hand: Mask | None) -> bool:
    if hand is None:
        return False
    inside = np.zeros(hand.shape, np.uint8)
    cv2.fillConvexPoly(inside, np.round(corners).astype(np.int32), 1)
    return bool(np.mean(hand[inside > 0]) > MAX_HAND_OVERLAP) if inside.any() else True


def _gradient(image: Image) -> NDArray[np.float32]:
    """Strongest gradient over the three colours ``(h, w, 2)``."""
    soft = cv2.GaussianBlur(image, (3, 3), 0.8)
    gx, gy = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
    best = np.argmax(gx**2 + gy**2, axis=2)[..., None]
    parts = [np.take_along_axis(g, best, axis=2)[..., 0] for g in (gx, gy)]
    return np.stack(parts, axis=-1)


def _refined(corners: Array, gradient: NDArray[np.float32]) -> Array | None:
    """Corners where the lines through the sides' edges meet; None where a side has no edge."""
    lines = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        line = _edge_line(a, b, gradient)
        if line is None:
            return None
        lines.append(line)
    meet = []
    for k in range(4):
        (n1, d1), (n2, d2) = lines[k - 1], lines[k]
        meet.append(np.linalg.solve(np.stack([n1, n2]), [d1, d2]))
    return np.array(meet)


def _edge_line(a: Array, b: Array, gradient: NDArray[np.float32]) -> tuple[Array, float] | None:
    """Normal and offset of the line through the strongest gradients across the side ``a b``."""
    along = b - a
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    n = max(8, int(np.linalg.norm(along) / 2))
    where = a + np.linspace(_CLEAR_OF_CORNERS, 1 - _CLEAR_OF_CORNERS, n)[:, None] * along
    reach = np.arange(-SEARCH_PX, SEARCH_PX + 0.25, 0.25)
    points = (where[:, None] + reach[:, None] * normal).astype(np.float32)
    x, y = np.ascontiguousarray(points[..., 0]), np.ascontiguousarray(points[..., 1])
    sampled = cv2.remap(gradient, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    strength = np.abs(sampled @ normal.astype(np.float32))
    weight = np.where(strength > 0.5 * strength.max(axis=1, keepdims=True), strength, 0)
    offset = (weight * reach).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-6)
    edge = where + offset[:, None] * normal
    strong = strength.max(axis=1) > 0.25 * np.median(strength.max(axis=1)) + 1.0
    if strong.sum() < 0.6 * n:
        return None
    vx, vy, x0, y0 = cv2.fitLine(edge[strong].astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01)
    line = np.array([-vy, vx], float).ravel()
    return line, float(line @ np.array([x0, y0], float).ravel())


def _mm_per_px(corners: Array) -> float:
    length = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    long, short = (length[0] + length[2]) / 2, (length[1] + length[3]) / 2
    return float(np.sqrt(CARD_MM[0] * CARD_MM[1] / (long * short)))
