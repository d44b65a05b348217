"""The outline of a silhouette, between pixels, at the picture's own edge.

A smoothed log-odds map ``L`` gives the mask ``L > 0``; its boundary pixels, chained, give a normal
``n`` at each. Each point goes, along its normal, to the zero of ``L`` and from there towards a
maximum of the gradient within ``SUPPORT_PX``. Both err inwards: colours mix across an outline, and
mixtures that were never seen count as background; a round finger darkens towards its rim and may
change fastest well inside. So the point goes most of the way to a maximum that lies outside of the
zero, and little of the way to one inside. The offsets are smoothed along the chain by a median.

>>> mask = np.zeros((60, 60), np.float32)
>>> yy, xx = np.mgrid[:60, :60]
>>> L = np.clip(20 - np.hypot(xx - 30, yy - 30), -3, 3).astype(np.float32)
>>> outline = trace(L > 0, L, np.zeros_like(L))
>>> r = np.hypot(*(outline.points - 30).T)
>>> bool(np.abs(r - 20).max() < 0.3)
True
>>> bool((np.einsum("ij,ij->i", outline.points - 30, outline.normals) > 0.9 * 20).all())
True
"""

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

#: Farthest from the zero of the log odds that a gradient maximum confirms it and moves it.
SUPPORT_PX = 1.5
#: Share of the way that it moves it.
OUTWARDS, INWARDS = 0.8, 0.2
#: Outlines of parts and holes shorter than this are specks.
MIN_LENGTH_PX = 16
MAX_HOLE_PX = 12
#: Within this distance the signed distance is that of the outline's points, not its pixels.
NEAR_PX = 12.0
_NORMAL_ARM = 3  # pixels of chain to either side that define a normal


@dataclass(frozen=True, eq=False)
class Outline:
    """Points ``(m, 2)`` of an outline, unit normals ``(m, 2)`` pointing out of the silhouette,
    ``snapped`` ``(m,)``: the picture has an edge there, and ``chain`` ``(m,)``: which loop."""

    points: Float
    normals: Float
    snapped: Mask
    chain: NDArray[np.int32]


def clean(positive: Mask, seed: Mask | None, min_share: float = 0.02) -> Mask:
    """The hand among the components of a mask ``(h, w)``: specks dropped, pinholes filled.

    With a ``seed``, the component that overlaps it most, and every other that is mostly inside
    it (a finger cut off by a ring). Without, the largest. Two strokes that touch by a corner stay
    apart (4-connected).
    """
    n, labels = cv2.connectedComponents(positive.view(np.uint8), connectivity=4)
    area, overlap = np.zeros(n, np.int64), np.zeros(n, np.int64)
    count_kernel(labels, positive if seed is None else seed, area, overlap)
    if n == 1 or overlap[1:].max() == 0:
        return np.zeros_like(positive)
    keep = (overlap > 0.6 * area) & (area > min_share * overlap[1:].max()) & (seed is not None)
    keep[1 + np.argmax(overlap[1:])] = True
    keep[0] = False
    mask = np.empty(positive.shape, np.uint8)
    choose_kernel(labels, keep, mask)
    chains, family = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    for k, chain in enumerate(chains):
        if family[0, k, 3] >= 0 and len(chain) <= 4 + MAX_HOLE_PX / 2:
            cv2.drawContours(mask, chains, k, 1, cv2.FILLED)
    return mask.view(bool)


def trace(mask: Mask, log_odds: Float, gradient: Float) -> Outline:
    """The outline of ``mask`` ``(h, w)``, refined by the maps ``(h, w)`` as the module says."""
    chains, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parts = []
    for k, chain in enumerate(chains):
        if len(chain) >= MIN_LENGTH_PX:
            xy = chain[:, 0].astype(np.float32)
            parts.append((*refine_kernel(xy, log_odds, gradient), np.full(len(xy), k)))
    if not parts:
        none = np.zeros((0, 2), np.float32)
        return Outline(none, none, np.zeros(0, bool), np.zeros(0, np.int32))
    points, normals, snapped, index = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Outline(points, normals, snapped, index.astype(np.int32))


def signed_distance(mask: Mask, outline: Outline) -> Float:
    """Signed distance ``(h, w)`` in px to an outline, negative inside ``mask`` ``(h, w)``.

    Exact distance to the nearest outline point among those near the nearest outline pixel, so
    that it is zero between pixels where the outline is; far away it is that of the pixels.
    """
    far = float(sum(mask.shape))
    if len(outline.points) == 0:
        return np.full(mask.shape, -far if mask.all() else far, np.float32)
    canvas = np.ones(mask.shape, np.uint8)
    pixel = np.clip(np.rint(outline.points), 0, np.array(mask.shape[::-1]) - 1).astype(int)
    canvas[pixel[:, 1], pixel[:, 0]] = 0
    distance, labels = cv2.distanceTransformWithLabels(
        canvas, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner = np.zeros(int(labels.max()) + 1, np.int32)
    owner[labels[pixel[:, 1], pixel[:, 0]]] = np.arange(len(pixel))
    out = np.empty(mask.shape, np.float32)
    distance_kernel(mask, distance, labels, owner, outline.points, outline.normals, out)
    return out


@numba.njit(cache=True, nogil=True)
def count_kernel(labels, seed, area, overlap):  # type: ignore[no-untyped-def]
    """Count each label's pixels ``(n,)``, and those of them in the seed ``(h, w)``."""
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            area[labels[i, j]] += 1
            if seed[i, j]:
                overlap[labels[i, j]] += 1


@numba.njit(cache=True, nogil=True)
def choose_kernel(labels, keep, mask):  # type: ignore[no-untyped-def]
    """Fill ``mask`` ``(h, w)`` with whether each pixel's label is kept."""
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            mask[i, j] = keep[labels[i, j]]


@numba.njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def sample(image, x, y):  # type: ignore[no-untyped-def]
    """Bilinear value of ``image`` ``(h, w)``, held constant beyond its border."""
    h, w = image.shape
    x = min(max(x, 0.0), w - 1.001)
    y = min(max(y, 0.0), h - 1.001)
    j, i = int(x), int(y)
    u, v = x - j, y - i
    top = (1 - u) * image[i, j] + u * image[i, j + 1]
    bottom = (1 - u) * image[i + 1, j] + u * image[i + 1, j + 1]
    return (1 - v) * top + v * bottom


@numba.njit(cache=True, nogil=True, fastmath=True)
def refine_kernel(chain, log_odds, gradient):  # type: ignore[no-untyped-def]
    """Points, outward normals and whether snapped, of a closed chain ``(m, 2)`` of pixels."""
    m = len(chain)
    normals = np.empty((m, 2), np.float32)
    offset = np.empty(m, np.float32)
    snapped = np.zeros(m, np.bool_)
    for k in range(m):
        tx, ty = 0.0, 0.0
        for a in range(1, _NORMAL_ARM + 1):
            ahead, behind = (k + a) % m, (k - a) % m
            tx += chain[ahead, 0] - chain[behind, 0]
            ty += chain[ahead, 1] - chain[behind, 1]
        length = np.sqrt(tx * tx + ty * ty)
        if length < 1e-6:  # the very end of a stroke one pixel wide
            ty = chain[(k + 1) % m, 0] - chain[k, 0]
            tx = chain[k, 1] - chain[(k + 1) % m, 1]
            length = max(np.sqrt(tx * tx + ty * ty), 1e-6)
        nx, ny = -ty / length, tx / length
        # outwards is where the log odds fall
        inward = sample(log_odds, chain[k, 0] - nx, chain[k, 1] - ny)
        outward = sample(log_odds, chain[k, 0] + nx, chain[k, 1] + ny)
        if outward > inward:
            nx, ny = -nx, -ny
        normals[k, 0], normals[k, 1] = nx, ny
        offset[k], snapped[k] = settle(chain[k], nx, ny, log_odds, gradient)
    points = np.empty((m, 2), np.float32)
    window = np.empty(5, np.float32)
    for k in range(m):
        for a in range(5):
            window[a] = offset[(k + a - 2) % m]
        middle = np.sort(window)[2]
        t = min(max(offset[k], middle - 0.35), middle + 0.35)
        points[k, 0] = chain[k, 0] + t * normals[k, 0]
        points[k, 1] = chain[k, 1] + t * normals[k, 1]
    return points, normals, snapped


@numba.njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def settle(pixel, nx, ny, log_odds, gradient):  # type: ignore[no-untyped-def]
    """Offset along the normal to the zero of the log odds, or towards the gradient's maximum."""
    x, y = pixel[0], pixel[1]
    before = sample(log_odds, x, y)
    zero = 0.5
    for step in range(1, 7):
        t = 0.25 * step
        after = sample(log_odds, x + t * nx, y + t * ny)
        if after <= 0:
            zero = t - 0.25 * after / min(after - before, -1e-6)
            break
        before = after
    best, best_g = -1, 0.0
    n = round(2 * SUPPORT_PX / 0.5) + 1
    for s in range(n):
        t = zero - SUPPORT_PX + 0.5 * s
        g = sample(gradient, x + t * nx, y + t * ny) * (1 - 0.2 * abs(t - zero) / SUPPORT_PX)
        if g > best_g:
            best, best_g = s, g
    if best <= 0 or best >= n - 1 or best_g < 1e-3:
        return zero, False
    t = zero - SUPPORT_PX + 0.5 * best
    a = sample(gradient, x + (t - 0.5) * nx, y + (t - 0.5) * ny)
    b = sample(gradient, x + t * nx, y + t * ny)
    c = sample(gradient, x + (t + 0.5) * nx, y + (t + 0.5) * ny)
    curve = a - 2 * b + c
    shift = 0.25 * (a - c) / curve if curve < -1e-6 else 0.0
    t += min(max(shift, -0.5), 0.5)
    return zero + (OUTWARDS if t > zero else INWARDS) * (t - zero), True


@numba.njit(cache=True, nogil=True, fastmath=True)
def distance_kernel(mask, distance, labels, owner, points, normals, out):  # type: ignore[no-untyped-def]
    """Distance to the owner of each pixel's label or a neighbour on its chain, with a sign."""
    h, w = mask.shape
    m = len(points)
    for i in range(h):
        for j in range(w):
            if distance[i, j] > NEAR_PX:
                out[i, j] = -distance[i, j] if mask[i, j] else distance[i, j]
                continue
            k0 = owner[labels[i, j]]
            best, nearest = 1e12, k0
            for a in range(-2, 3):
                k = (k0 + a) % m
                d = (points[k, 0] - j) ** 2 + (points[k, 1] - i) ** 2
                if d < best:
                    best, nearest = d, k
            along = (j - points[nearest, 0]) * normals[nearest, 0]
            along += (i - points[nearest, 1]) * normals[nearest, 1]
            if best < 2.25:  # so near, the side of the outline decides, not the pixel
                out[i, j] = along
            else:
                out[i, j] = -np.sqrt(best) if mask[i, j] else np.sqrt(best)
