"""Landmarks of an open hand in its silhouette: tips, valleys, wrist, and which side it is.

The outline, its five tips and the palm's disc of radius ``r`` come from :mod:`calib.tips`. A
**valley** is the deepest point under the chord of two neighbouring tips. The **thumb** is the end
with the lower valley, the lower tip and the wider angle, which gives the side of a palm that faces
the camera. The **wrist** is the neck of the outline under the palm. Where the signs disagree the
answer is a refusal with its reason, never a guess.

>>> import numpy as np
>>> landmarks, seen = search_landmarks(np.ones((64, 64), bool))
>>> landmarks is None, seen.sentence
(True, 'fewer than five fingertips stand out: open the hand and spread the fingers')
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.seen import Seen
from calib.tips import (
    ARM,
    STEPS_PER_RADIUS,
    clear_of_border,
    five_tips,
    palm_candidates,
    resampled,
    signed_area,
    unit,
    values_at,
)
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Usual length of a digit from its valleys to its tip, in palm radii, thumb to little.
USUAL_REACH_R = np.array([1.35, 1.75, 1.95, 1.8, 1.35])
#: Share of it below which a digit is bent or tilted away; a thumb may point at the camera.
LEAST_REACH = np.array([0.35, 0.55, 0.55, 0.55, 0.55])
#: Reach over the usual, and angle between neighbours, beyond which it is no open hand.
REACH_RANGE = (0.4, 1.8)
#: The wrist: levels below the palm, how far ahead they are compared, and its greatest width.
LEVEL_STEP_R = 0.05
NECK_LEVELS = 10
MAX_NECK_WIDTH_R = 1.6
#: Height over the wrist's neck, in palm radii, of the thumb's first joint: below it the outline is
#: the wrist's, above it the back of the thumb.
THUMB_BASE_R = 0.65
MAX_SPREAD_DEG = (120.0, 80.0, 80.0, 80.0)


@dataclass(frozen=True, eq=False)
class Landmarks:
    """An open hand's landmarks in pixels; the outline runs from the wrist's thumb side round.

    Digits are ordered thumb to little. ``label`` is the digit a contour point belongs to, -1 on
    the palm, in the valleys and on the forearm. ``side`` holds for a palm facing the camera.
    """

    centre_px: Array  # (2,)
    radius_px: float
    contour_px: Array  # (n, 2)
    label: NDArray[np.int64]  # (n,)
    tip_index: NDArray[np.int64]  # (5,) into the contour
    valley_index: NDArray[np.int64]  # (4,) thumb-index, index-middle, middle-ring, ring-little
    up: Array  # (2,) unit, wrist to fingers
    wrist_px: Array  # (2,)
    wrist_width_px: float
    wrist_seen: bool  # a neck was found; otherwise the wrist is put where it usually is
    side: str  # "right" or "left"

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def tips_px(self) -> Array:
        """Fingertips ``(5, 2)``, thumb to little."""
        return self.contour_px[self.tip_index]

    @property
    def valleys_px(self) -> Array:
        """Valleys ``(4, 2)`` between neighbouring digits."""
        return self.contour_px[self.valley_index]

    @property
    def reach_r(self) -> Array:
        """Length ``(5,)`` of each digit from its valleys to its tip, in palm radii."""
        v = self.valleys_px
        roots = np.array([v[0], v[1], (v[1] + v[2]) / 2, (v[2] + v[3]) / 2, v[3]])
        return np.asarray(np.linalg.norm(self.tips_px - roots, axis=1) / self.radius_px)


def find_landmarks(mask: Mask, visible: Mask | None = None) -> Landmarks | None:
    """Landmarks of the open hand in ``mask`` ``(h, w)``, or None (see :func:`search_landmarks`)."""
    return search_landmarks(mask, visible)[0]


def search_landmarks(mask: Mask, visible: Mask | None = None) -> tuple[Landmarks | None, Seen]:
    """Landmarks of the open hand in ``mask`` ``(h, w)``, and what was seen.

    ``visible`` ``(h, w)`` is where the picture goes on, if that is not all of the mask.
    """
    seen = Seen.NOTHING
    clear = clear_of_border(np.ones_like(mask) if visible is None else visible)
    for centre, radius, outline in palm_candidates(mask):
        contour = resampled(outline, radius)
        if len(contour) < 10 * ARM:
            continue
        found, here = five_tips(contour, centre, radius, values_at(clear, contour))
        if here is Seen.OPEN_HAND and found is not None:
            landmarks = _describe(contour, centre, radius, found)
            if landmarks is not None and _has_proportions(landmarks):
                return landmarks, Seen.OPEN_HAND
            here = Seen.NO_THUMB if landmarks is None else Seen.NO_HAND
        seen = here if seen in (Seen.NOTHING, Seen.FEW_TIPS) else seen
    return None, seen


def start_quality(landmarks: Landmarks) -> float:
    """How good a start this hand is, 0 to 1: the worst of reach, spread and straightness.

    A digit much shorter than usual is bent or tilted away; neighbours that hardly spread leave
    their valleys, and so the knuckles, undefined; a finger whose midline bends is curled.
    """
    reach = landmarks.reach_r / USUAL_REACH_R
    spread = np.degrees(_spread_angles(landmarks))
    terms = (
        float(np.min((reach - LEAST_REACH) / 0.3)),
        float((reach[1:].min() / reach[1:].max() - 0.4) / 0.3),
        float((spread[0] - 10) / 20),
        float(np.min((spread[1:] - 2) / 6)),
        float((0.16 - _bow(landmarks).max()) / 0.08),
    )
    return float(np.clip(min(terms), 0.0, 1.0))


def is_good_start(landmarks: Landmarks | None, threshold: float = 0.35) -> bool:
    """Whether the hand is open, frontal and spread enough to calibrate and to start from."""
    return landmarks is not None and start_quality(landmarks) >= threshold


def _has_proportions(landmarks: Landmarks) -> bool:
    """Whether digits are as long, and spread as little, as those of a hand."""
    reach = landmarks.reach_r / USUAL_REACH_R
    low, high = REACH_RANGE
    narrow = np.degrees(_spread_angles(landmarks)) < MAX_SPREAD_DEG
    return bool((reach > low).all() and (reach < high).all() and narrow.all())


def _describe(
    contour: Array, centre: Array, radius: float, tips: NDArray[np.int64]
) -> Landmarks | None:
    """Valleys, thumb, wrist and labels of a hand with five tips; None without a clear thumb."""
    n = len(contour)
    middle = (tips[-1] + ((tips[0] - tips[-1]) % n) // 2) % n  # of the wrist's gap
    contour, tips = np.roll(contour, -middle, axis=0), (tips - middle) % n
    valleys = np.array([_valley(contour, i, j) for i, j in itertools.pairwise(tips)])
    end = _thumb_end(contour[tips], contour[valleys], centre, radius)
    if end is None:
        return None
    if end == 4:
        contour, tips, valleys = contour[::-1], (n - 1 - tips)[::-1], (n - 1 - valleys)[::-1]
    # round from the thumb: counter-clockwise on the screen is a right palm
    side = "right" if signed_area(contour) < 0 else "left"
    up = unit(contour[tips[1:4]].mean(axis=0) - centre)
    found = Landmarks(
        centre_px=centre,
        radius_px=radius,
        contour_px=contour,
        label=np.full(n, -1, np.int64),
        tip_index=tips,
        valley_index=valleys,
        up=up,
        wrist_px=centre - 1.25 * radius * up,
        wrist_width_px=1.3 * radius,
        wrist_seen=False,
        side=side,
    )
    return _with_labels(_with_wrist(found))


def _valley(contour: Array, i: int, j: int) -> int:
    """The point of the outline between tips ``i < j`` that is deepest under their chord."""
    between = np.arange(i, j + 1)
    chord = contour[j] - contour[i]
    depth = np.abs((contour[between] - contour[i]) @ np.array([-chord[1], chord[0]]))
    return int(between[np.argmax(depth)])


def _thumb_end(tips: Array, valleys: Array, centre: Array, radius: float) -> int | None:
    """0 or 4: which end of the row of tips is the thumb; None where the signs disagree."""
    up = unit(tips[1:4].mean(axis=0) - centre)
    height = (valleys - centre) @ up / radius
    tip = (tips - centre) @ up / radius
    angle = [
        _angle(tips[0] - valleys[0], tips[1] - valleys[0]),
        _angle(tips[4] - valleys[3], tips[3] - valleys[3]),
    ]
    signs = np.array(
        [
            (height[3] - height[0]) / 0.35,
            (tip[4] - tip[0]) / 0.8,
            (angle[0] - angle[1]) / 0.6,
        ]
    )
    total = float(signs.sum())
    agree = np.sign(signs) == np.sign(total)
    if abs(total) < 1.2 or not agree[0] or agree.sum() < 2 or abs(signs[0]) < 0.4:
        return None
    return 0 if total > 0 else 4


def _angle(a: Array, b: Array) -> float:
    """Angle in radians between two plane vectors."""
    return float(np.arccos(np.clip(unit(a) @ unit(b), -1.0, 1.0)))


def _spread_angles(landmarks: Landmarks) -> Array:
    """Angle ``(4,)`` at each valley between the two tips beside it, radians."""
    tips, valleys = landmarks.tips_px, landmarks.valleys_px
    return np.array([_angle(tips[d] - valleys[d], tips[d + 1] - valleys[d]) for d in range(4)])


def _bow(landmarks: Landmarks) -> Array:
    """How far each finger's midline leaves the straight, over its length, ``(4,)``."""
    bow = []
    for d in range(1, 5):
        tip = landmarks.tip_index[d]
        steps = min(tip - landmarks.valley_index[d - 1], 2 * STEPS_PER_RADIUS)
        if d < 4:
            steps = min(steps, landmarks.valley_index[d] - tip)
        k = np.arange(ARM // 2, max(steps - ARM // 2, ARM))
        middle = (landmarks.contour_px[tip - k] + landmarks.contour_px[tip + k]) / 2
        axis = unit(middle[0] - middle[-1])
        off = (middle - middle[-1]) @ np.array([-axis[1], axis[0]])
        bow.append(np.ptp(off) / max(np.linalg.norm(middle[0] - middle[-1]), 1.0))
    return np.array(bow)


def _with_wrist(landmarks: Landmarks) -> Landmarks:
    """Put the wrist at the neck of the outline under the palm, if there is one."""
    contour, up, r = landmarks.contour_px, landmarks.up, landmarks.radius_px
    across = np.array([-up[1], up[0]])
    depth = -(contour - landmarks.centre_px) @ up / r
    offset = (contour - landmarks.centre_px) @ across
    n = len(contour)
    thumb_side = np.arange(landmarks.tip_index[0])
    little_side = np.arange(landmarks.tip_index[4], n)
    levels = np.arange(0.8, 2.6, LEVEL_STEP_R)
    width, middle = np.full(len(levels), np.nan), np.zeros(len(levels))
    for k, level in enumerate(levels):
        a = thumb_side[depth[thumb_side] >= level]
        b = little_side[depth[little_side] >= level]
        if len(a) and len(b):
            # the crossings nearest to the digits, so that a bent forearm does not matter
            edges = offset[a[-1]], offset[b[0]]
            width[k], middle[k] = abs(edges[0] - edges[1]), sum(edges) / 2
    if np.isnan(width).all() or np.isnan(width[0]):
        return landmarks
    neck = _neck(width / r)
    usual = int(np.nanargmin(np.abs(levels - 1.25) + 9 * np.isnan(width)))
    k = usual if neck is None else neck
    return replace(
        landmarks,
        wrist_px=landmarks.centre_px - levels[k] * r * up + middle[k] * across,
        wrist_width_px=float(width[k]),
        wrist_seen=neck is not None,
    )


def _neck(width_r: Array) -> int | None:
    """The first level below the palm from which the outline hardly narrows any more."""
    for k in range(1, len(width_r) - NECK_LEVELS // 2):
        ahead = width_r[k : k + NECK_LEVELS]
        if np.isnan(ahead[: NECK_LEVELS // 2]).any():
            return None  # cut off before the neck
        if width_r[k] < MAX_NECK_WIDTH_R and width_r[k] <= 1.03 * np.nanmin(ahead):
            return k
    return None


def _with_labels(landmarks: Landmarks) -> Landmarks:
    """Give each digit its stretch of the outline, clear of the valleys."""
    tip, valley = landmarks.tip_index, landmarks.valley_index
    label = np.full(len(landmarks.contour_px), -1, np.int64)
    clear = ARM // 2
    for d in range(5):
        inner = valley[d] - tip[d] if d < 4 else tip[d] - valley[d - 1]
        begin = tip[d] - (valley[d - 1] if d > 0 else 0)
        begin = inner if d in (0, 1) else begin  # the outer side of the index, and the thumb's
        end = inner
        label[tip[d] - begin + clear : tip[d] + end - clear + 1] = d
    depth = -(landmarks.contour_px - landmarks.wrist_px) @ landmarks.up / landmarks.radius_px
    outer = np.arange(len(label)) <= tip[0]
    label[outer & (depth < -THUMB_BASE_R)] = 0  # the thumb's back, down to its base
    return replace(landmarks, label=label)
