"""Where a hand might be, before anything is known: candidate silhouettes of a whole frame.

Nothing is known of the clip, so several independent cues each propose, on a small picture
(320 px on the long side), and every proposal is scored by the same questions:

- *shape*: what a network takes for a hand, whatever its colour
  (:mod:`~handtrack.evidence.shape_cue`), at two sizes of the picture, the smaller one mirrored, and
  by their mean; other cues' proposals are the more plausible the more they overlap with it;
- *skin*: a prior over chromaticity that holds from very pale to very dark skin, under any light
  that a camera has balanced: ``(log R/G, log G/B) ~ N``. Skin differs in brightness far more than
  in this;
- *backdrop*: what is unlike the smooth colour model of the border
  (:func:`~handtrack.evidence.background.smooth_backdrop`): any hand on any plain wall;
- *motion*: what is unlike the background of earlier frames, if there is one;
- *parts*: the colour clusters of what the other cues found, since a sleeve differs from its hand;
- *clusters*: the colour clusters of the whole picture.

Each first guess is refined by a few rounds of expectation and maximisation with colour histograms
of inside and outside, then cut into connected components. A later stage asks each of them whether
it is a hand; here only the plainly impossible is dropped.

>>> picture = np.full((120, 160, 3), (60, 80, 160), np.uint8)
>>> picture[30:90, 50:110] = (90, 90, 90)
>>> best = find_candidates(picture)[0]
>>> int(best.mask[60, 80]), int(best.mask[5, 5]), bool(0 < best.score <= 1)
(1, 0, True)
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import call

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.evidence import shape_cue
from handtrack.evidence.background import Background, shrink, smooth_backdrop
from handtrack.evidence.colour import ColourModel, largest_channel, to_ycc
from handtrack.parallel import each
from handtrack.records import freeze_arrays

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

LONG_SIDE_PX = 320
MAX_CANDIDATES = 8
#: Chromaticity of skin: mean and standard deviation of ``(log R/G, log G/B)``.
SKIN_MEAN = (0.30, 0.20)
SKIN_STD = (0.13, 0.20)
#: Least spread of a hand's own chromaticity.
LEAST_CHROMA_SIGMA = 0.05
#: So many of the best candidates are also tried without what is of another colour, if what is left
#: is such a share of them.
PURIFIED, PURER_SHARE = 2, (0.5, 0.985)
#: Long sides of the pictures that the shape cue sees, and whether it sees their mirror images.
SHAPE_VIEWS = ((160, True), (320, False))
#: Log odds by the shape cue that are clear.
CLEAR_SHAPE = 1.5
#: A hand takes this share of the picture.
AREA_RANGE = (0.008, 0.6)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A silhouette that might be a hand.

    Attributes
    ----------
    mask : (H, W) bool
        At the size of the frame; worked out on a smaller one, so its outline is rough.
    score : float
        Plausibility between 0 and 1; only the order means something.
    cue : str
        What proposed it: "shape", "skin", "backdrop", "motion", "parts", "clusters" or "learned";
        "pure" for the one-coloured part of the candidate before it.
    """

    mask: Mask
    score: float
    cue: str

    def __post_init__(self) -> None:
        freeze_arrays(self)


def find_candidates(frame_rgb: Pixels, background: Background | None = None) -> list[Candidate]:
    """Candidate silhouettes of a whole frame ``(H, W, 3)``, the most plausible first."""
    small = shrink(frame_rgb, LONG_SIDE_PX)
    soft = np.asarray(cv2.GaussianBlur(small, (3, 3), 0), np.uint8)
    size = soft.shape[1::-1]
    shapes = [
        shape_cue.log_odds_sized(shrink(frame_rgb, side), size, mirrored)
        for side, mirrored in SHAPE_VIEWS
    ]
    shapes.append(np.mean(shapes, axis=0, dtype=np.float32))
    guesses = _guesses(frame_rgb, soft, background, shapes)
    return ranked(soft, guesses, frame_rgb.shape[1::-1], shapes)


def ranked(
    rgb: Pixels,
    guesses: Iterable[tuple[str, Mask]],
    size: tuple[int, ...],
    shapes: Sequence[Float] = (),
) -> list[Candidate]:
    """Candidates among the parts of guesses, the most plausible first, without copies.

    Parameters
    ----------
    rgb : (h, w, 3)
        The small picture.
    guesses : of (cue, (h, w) mask)
    size : (2,)
        Width and height of the frame, which the candidates get.
    shapes : of (h, w)
        Log odds by the shape cue, if it was asked; what it takes for a hand is more plausible.
    """
    gradient = _gradient(rgb)
    seen = [np.asarray(1 / (1 + np.exp(-odds)), np.float32) for odds in shapes]
    found: list[Candidate] = []
    for cue, guess in guesses:
        for mask in components(guess):
            if (score := plausibility(rgb, mask, gradient)) > 0:
                if seen:
                    score *= 0.1 + 0.9 * max(_overlap(mask, P) for P in seen)
                found.append(Candidate(mask, score, cue))
    found.sort(key=lambda candidate: -candidate.score)
    return [
        Candidate(cv2.resize(c.mask.astype(np.float32), size) > 0.5, c.score, c.cue)
        for c in _with_purer_ones(rgb, _distinct(found))[:MAX_CANDIDATES]
    ]


def one_coloured(rgb: Pixels, mask: Mask) -> Mask:
    """The part of a mask ``(h, w)`` whose chromaticity is that of most of it.

    Light and shade leave ``(log R/G, log G/B)`` as it is; a pink thing that touches the hand does
    not have the hand's.
    """
    soft = np.asarray(cv2.GaussianBlur(rgb, (5, 5), 0), np.uint8)
    ratio = np.stack(chromaticity(soft), axis=-1)
    inside = ratio[mask]
    middle = np.median(inside, axis=0)
    sigma = np.maximum(1.5 * np.median(np.abs(inside - middle), axis=0), LEAST_CHROMA_SIGMA)
    alike = (np.abs(ratio - middle) < 4 * sigma).all(axis=-1)
    return np.asarray(mask & alike, bool)


def skin_log_odds(rgb: Pixels) -> Float:
    """Log odds ``(h, w)`` of skin by chromaticity alone, for any tone; dark pixels say less."""
    log_rg, log_gb = chromaticity(rgb)
    z2 = ((log_rg - SKIN_MEAN[0]) / SKIN_STD[0]) ** 2 + ((log_gb - SKIN_MEAN[1]) / SKIN_STD[1]) ** 2
    sure = np.clip((rgb[..., 0].astype(np.float32) - 11) / 40, 0, 1)
    return np.asarray(sure * np.clip(2.0 - 0.5 * z2, -4, 2), np.float32)


def chromaticity(rgb: Pixels) -> tuple[Float, Float]:
    """``log R/G`` and ``log G/B`` ``(h, w)``, steadied where it is dark."""
    R, G, B = (np.log(rgb[..., c].astype(np.float32) + 4.0) for c in range(3))
    return R - G, G - B


def components(mask: Mask) -> list[Mask]:
    """Connected parts ``(h, w)`` of a mask that are large enough, smoothed, small holes filled."""
    m = cv2.medianBlur(mask.astype(np.uint8), 5)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(m, connectivity=4)
    order = np.argsort(-stats[1:, cv2.CC_STAT_AREA])[:3] + 1
    least = AREA_RANGE[0] * mask.size
    return [fill_holes(labels == k) for k in order if stats[k, cv2.CC_STAT_AREA] >= least]


def fill_holes(mask: Mask, share: float = 0.01) -> Mask:
    """``mask`` with holes filled that are smaller than ``share`` of it."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats((~mask).astype(np.uint8), connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < share * mask.sum()
    small[0] = False
    return np.asarray(mask | small[labels], bool)


def plausibility(rgb: Pixels, mask: Mask, gradient: Float) -> float:
    """Score of a component ``(h, w)`` between 0 (impossible) and 1; see the module's questions.

    Its area; how much of its outline is the picture's border, and on how many sides; how solid
    and how smooth it is; whether the picture has an edge along its outline; whether its colours
    are its own; and, for a little, whether they are those of skin.
    """
    h, w = mask.shape
    area = float(mask.mean())
    if not AREA_RANGE[0] <= area <= AREA_RANGE[1]:
        return 0.0
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outer = max(contours, key=cv2.contourArea)
    hull_area = cv2.contourArea(cv2.convexHull(outer))
    points = np.concatenate(contours)[:, 0]
    x, y = points[:, 0], points[:, 1]
    sides = [x == 0, x == w - 1, y == 0, y == h - 1]
    on_border = float(np.mean(np.any(sides, axis=0)))
    n_sides = sum(bool(side.sum() > 0.03 * len(points)) for side in sides)
    solidity = float(mask.sum()) / max(hull_area, 1.0)
    roughness = len(points) / np.sqrt(mask.sum())  # 3.5 for a disc, 5 fist to 11 spread hand
    inner = points[~np.any(sides, axis=0)]
    if len(inner) < 20:
        return 0.0
    support = float(np.mean(gradient[inner[:, 1], inner[:, 0]]))
    own = _separation(rgb, mask)
    skin = float(1 / (1 + np.exp(-np.mean(skin_log_odds(rgb[mask][::3])))))
    score = min(1.0, area / 0.03) * min(1.0, (AREA_RANGE[1] - area) / 0.25)
    score *= (1.0, 1.0, 0.75, 0.3, 0.1)[n_sides] * max(0.05, 1 - 1.5 * on_border)
    score *= np.clip((solidity - 0.2) / 0.3, 0.05, 1) * np.clip((16 - roughness) / 6, 0.05, 1)
    return float(score * (0.2 + 0.8 * support) * own * (0.5 + 0.5 * skin))


def _guesses(
    frame_rgb: Pixels, soft: Pixels, background: Background | None, shapes: Sequence[Float]
) -> Iterator[tuple[str, Mask]]:
    """First guesses of each cue, refined, ``(h, w)``."""
    *sizes, both = shapes
    backdrop, sigma = smooth_backdrop(soft)
    distance = np.linalg.norm(soft - backdrop, axis=-1)
    unlike = distance > max(3.5 * sigma, _otsu(distance) * 0.6)
    refinements = [partial(refine, soft, np.clip(odds, -4, 4), fading=1.0) for odds in sizes]
    refinements += [
        partial(refine, soft, skin_log_odds(soft)),
        partial(refine, soft, np.where(unlike, 2.0, -2.0).astype(np.float32), rounds=2),
    ]
    *by_shape, skin, by_backdrop = each(call, refinements)
    for whole in (*by_shape, both > 0, both > CLEAR_SHAPE):
        yield "shape", whole
    yield "skin", skin
    closed = cv2.morphologyEx(unlike.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5))) > 0
    wholes = [unlike, closed, by_backdrop]
    for whole in wholes:
        yield "backdrop", whole
    moved = background.difference(frame_rgb) if background is not None else None
    if moved is not None:
        changed = cv2.resize(moved, soft.shape[1::-1], interpolation=cv2.INTER_AREA) > 5
        yield "motion", changed
        wholes.append(changed)
    for whole in wholes[2:]:
        if 0.01 < whole.mean() < 0.8:
            for part in colour_clusters(soft, whole, 3):
                yield "parts", part
            yield "parts", whole & skin
    for part in colour_clusters(soft, np.ones_like(skin), 4):
        yield "clusters", part


def refine(rgb: Pixels, log_odds: Float, rounds: int = 3, fading: float = 0.5) -> Mask:
    """A mask from first log odds ``(h, w)``, by rounds of learning colours and relabelling.

    The first log odds stay as a prior, times ``fading`` every round, so that rounds cannot wander
    far.
    """
    prior = log_odds
    flat = rgb[::2, ::2].reshape(-1, 3)
    for k in range(rounds):
        soft = np.asarray(cv2.GaussianBlur(log_odds, (5, 5), 0), np.float32)
        p = np.asarray(1 / (1 + np.exp(-soft[::2, ::2])), np.float32).reshape(-1)
        if not 0.002 < p.mean() < 0.9:
            break
        colours = ColourModel.from_samples(flat, flat, p, 1 - p)
        log_odds = np.clip(colours.log_odds(rgb), -4, 4) + prior * np.float32(fading**k)
    return np.asarray(cv2.GaussianBlur(log_odds, (5, 5), 0) > 0, bool)


def colour_clusters(rgb: Pixels, where: Mask, k: int) -> list[Mask]:
    """``k`` masks: clusters of the colours ``where`` (k-means in YCrCb, luma times 0.4)."""
    ycc = to_ycc(rgb) * np.array([0.4, 1.0, 1.0], np.float32)
    soft = cv2.GaussianBlur(ycc, (5, 5), 0)
    samples = np.ascontiguousarray(soft[where])
    if len(samples) < 50 * k:
        return []
    start = samples[:: max(1, len(samples) // 2000)]
    order = np.argsort(start @ np.array([0.3, 1.0, 0.5], np.float32))
    labels = np.array_split(order, k)
    centres = np.stack([start[index].mean(axis=0) for index in labels])
    for _ in range(10):
        nearest = np.argmin(((start[:, None] - centres) ** 2).sum(-1), axis=1)
        centres = np.stack(
            [start[nearest == c].mean(0) if np.any(nearest == c) else centres[c] for c in range(k)]
        )
    label = np.argmin(((samples[:, None] - centres) ** 2).sum(-1), axis=1)
    masks = np.zeros((k, *where.shape), bool)
    for c in range(k):
        masks[c][where] = label == c
    return list(masks)


def _separation(rgb: Pixels, mask: Mask) -> float:
    """Bhattacharyya distance of the colours inside and around a mask, as 0 (same) to 1."""
    near = cv2.dilate(mask.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0
    few = (slice(None, None, 2), slice(None, None, 2))
    bins = (to_ycc(rgb[few]).astype(int) - (0, 64, 64)).clip(0, (255, 127, 127)) // (16, 8, 8)
    index = bins @ (256, 16, 1)
    f = np.bincount(index[mask[few]], minlength=4096).astype(float)
    b = np.bincount(index[(near & ~mask)[few]], minlength=4096).astype(float)
    return float(1 - np.sqrt(f * b).sum() / max(np.sqrt(f.sum() * b.sum()), 1.0))


def _overlap(mask: Mask, P: Float) -> float:
    """Overlap over union of a mask ``(h, w)`` and a probability of it."""
    return float(P[mask].sum() / (mask.sum() + P[~mask].sum()))


def _gradient(rgb: Pixels) -> Float:
    """Gradient magnitude ``(h, w)``, largest within a pixel, over that of a clear edge."""
    picture = rgb.astype(np.float32)
    gx, gy = cv2.Sobel(picture, -1, 1, 0, scale=0.125), cv2.Sobel(picture, -1, 0, 1, scale=0.125)
    g = largest_channel(np.sqrt(gx**2 + gy**2))
    return np.asarray(np.clip(cv2.dilate(g, np.ones((3, 3), np.uint8)) / 10.0, 0, 1), np.float32)


def _otsu(values: Float) -> float:
    """Otsu's threshold of values, in their unit."""
    top = max(float(values.max()), 1e-6)
    scaled = (values * (255 / top)).astype(np.uint8)
    return float(cv2.threshold(scaled, 0, 255, cv2.THRESH_OTSU)[0]) * top / 255


def _with_purer_ones(rgb: Pixels, found: list[Candidate]) -> list[Candidate]:
    """Candidates, the best ones followed by their one-coloured part where that is another."""
    out: list[Candidate] = []
    for rank, c in enumerate(found):
        out.append(c)
        parts = components(one_coloured(rgb, c.mask)) if rank < PURIFIED else []
        if parts and PURER_SHARE[0] < parts[0].sum() / c.mask.sum() < PURER_SHARE[1]:
            others = found[:rank] + found[rank + 1 :]
            if not any(_alike(parts[0], other.mask) for other in others):
                out.append(Candidate(parts[0], c.score, "pure"))
    return out


def _alike(one: Mask, other: Mask) -> bool:
    """Whether two masks are nearly copies (overlap over union above 0.9)."""
    return bool((one & other).sum() >= 0.9 * (one | other).sum())


def _distinct(found: list[Candidate]) -> list[Candidate]:
    """The candidates without near copies of better ones."""
    kept: list[Candidate] = []
    for c in found:
        if not any(_alike(c.mask, k.mask) for k in kept):
            kept.append(c)
    return kept
