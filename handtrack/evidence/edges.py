"""Edges of a crop, weak ones inside the hand as well as its outline.

The gradient of a pixel is that of the colour channel that changes most there, after a blur of
``SIGMA_PX``. A finger folded over the palm differs from it by a little shading only, so strength
is relative to what is usual about the pixel (``mean g`` over a neighbourhood) and to the noise
``n`` of this crop (a low quantile of ``g``)::

    strength = g^2 / (g^2 + (2 n)^2 + (0.8 mean g)^2)        in 0..1

Edge points are the maxima of ``g`` across the edge, placed between pixels by a parabola, linked by
hysteresis: a chain shorter than ``MIN_CHAIN_PX``, or weak all along, is a crease or noise.

>>> picture = np.full((40, 40, 3), 50, np.uint8)
>>> picture[:, 20:] = 80
>>> edges = find_edges(picture)
>>> bool(np.abs(edges.points[:, 0] - 19.5).max() < 0.05), bool(abs(edges.normals[0, 0]) > 0.999)
(True, True)
"""

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.records import freeze_arrays

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]

SIGMA_PX = 1.0
NEIGHBOURHOOD_PX = 31
MIN_CHAIN_PX = 8
#: Strength at which a chain may go on, and which it must reach somewhere.
WEAK, STRONG = 0.35, 0.6
#: The crop's noise is at least this gradient (levels per px), so flat pictures have no edges.
LEAST_NOISE = 0.5


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of one crop; see the module for how strength is measured.

    Attributes
    ----------
    gradient : (h, w) float32
        Levels per pixel.
    strength : (h, w) float32
        0 to 1, a ridge along each edge.
    direction : (h, w) float32
        Angle of the gradient from x towards y, modulo pi.
    points, normals : (k, 2) float32
        Edge points in px and their unit gradient direction, sign without meaning.
    point_strength : (k,) float32
        ``strength`` at each point.
    """

    gradient: Float
    strength: Float
    direction: Float
    points: Float
    normals: Float
    point_strength: Float

    def __post_init__(self) -> None:
        freeze_arrays(self)


def find_edges(rgb: Pixels) -> Edges:
    """Edges of a crop ``(h, w, 3)``."""
    soft = cv2.GaussianBlur(rgb.astype(np.float32), (5, 5), SIGMA_PX)
    gx, gy, g = np.zeros((3, *rgb.shape[:2]), np.float32)
    gradient_kernel(soft, gx, gy, g)
    noise = max(LEAST_NOISE, float(np.quantile(g[::3, ::3], 0.25)))
    usual = cv2.blur(g, (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX))
    square = g * g
    rest = np.float32(4 * noise**2) + np.float32(0.64) * usual * usual
    strength: Float = np.asarray(square / (square + rest), np.float32)
    direction = np.asarray(np.mod(cv2.phase(gx, gy), np.float32(np.pi)), np.float32)
    thin, points, normals = thin_kernel(gx, gy, g, strength, WEAK)
    kept, value = _link(thin, points, strength)
    return Edges(g, strength, direction, points[kept], normals[kept], value[kept])


def _link(thin: Pixels, points: Float, strength: Float) -> tuple[NDArray[np.bool_], Float]:
    """Which points belong to a chain that is long and somewhere strong, and their strength."""
    if len(points) == 0:
        return np.zeros(0, bool), np.zeros(0, np.float32)
    n, labels, stats, _ = cv2.connectedComponentsWithStats(thin, connectivity=8)
    at = np.nonzero(thin)
    chain, value = np.asarray(labels[at], int), strength[at]
    best = np.zeros(n, np.float32)
    np.maximum.at(best, chain, value)
    return (stats[chain, cv2.CC_STAT_AREA] >= MIN_CHAIN_PX) & (best[chain] >= STRONG), value


@numba.njit(cache=True, fastmath=True)
def gradient_kernel(picture, gx, gy, g):  # type: ignore[no-untyped-def]
    """Scharr gradient ``(h, w)`` of the channel that changes most, of ``(h, w, 3)`` float32."""
    h, w = g.shape
    a, b = np.float32(3 / 32), np.float32(10 / 32)
    for i in range(1, h - 1):
        for j in range(1, w - 1):
            best = np.float32(0.0)
            for c in range(3):
                x = a * (
                    picture[i - 1, j + 1, c]
                    - picture[i - 1, j - 1, c]
                    + picture[i + 1, j + 1, c]
                    - picture[i + 1, j - 1, c]
                ) + b * (picture[i, j + 1, c] - picture[i, j - 1, c])
                y = a * (
                    picture[i + 1, j - 1, c]
                    - picture[i - 1, j - 1, c]
                    + picture[i + 1, j + 1, c]
                    - picture[i - 1, j + 1, c]
                ) + b * (picture[i + 1, j, c] - picture[i - 1, j, c])
                square = x * x + y * y
                if square > best:
                    best = square
                    gx[i, j], gy[i, j] = x, y
            g[i, j] = np.sqrt(best)


@numba.njit(cache=True, fastmath=True)
def thin_kernel(gx, gy, g, strength, weak):  # type: ignore[no-untyped-def]
    """Maxima of ``g`` across the edge: map ``(h, w)``, points ``(k, 2)``, normals ``(k, 2)``."""
    h, w = g.shape
    thin = np.zeros((h, w), np.uint8)
    points = np.empty((h * w // 2, 2), np.float32)
    normals = np.empty((h * w // 2, 2), np.float32)
    k = 0
    for i in range(2, h - 2):
        for j in range(2, w - 2):
            here = g[i, j]
            if strength[i, j] < weak or here <= 0 or k >= len(points):
                continue
            nx, ny = gx[i, j] / here, gy[i, j] / here
            # neighbours one step along the dominant axis, interpolated between two pixels
            if abs(nx) >= abs(ny):
                t = ny / nx
                d = 1 if t > 0 else -1
                u = abs(t)
                before = (1 - u) * g[i, j - 1] + u * g[i - d, j - 1]
                after = (1 - u) * g[i, j + 1] + u * g[i + d, j + 1]
                sx, sy = np.float32(1.0), t
            else:
                t = nx / ny
                d = 1 if t > 0 else -1
                u = abs(t)
                before = (1 - u) * g[i - 1, j] + u * g[i - 1, j - d]
                after = (1 - u) * g[i + 1, j] + u * g[i + 1, j + d]
                sx, sy = t, np.float32(1.0)
            if here < before or here <= after:
                continue
            curve = before - 2 * here + after
            shift = 0.5 * (before - after) / curve if curve < 0 else 0.0
            shift = min(max(shift, -0.5), 0.5)
            thin[i, j] = 1
            points[k, 0] = j + shift * sx
            points[k, 1] = i + shift * sy
            normals[k, 0], normals[k, 1] = nx, ny
            k += 1
    return thin, points[:k], normals[:k]
