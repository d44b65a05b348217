"""Edges of a crop, weak ones inside the hand as well as its outline.

The gradient of a pixel is that of the colour channel that changes most there, after a blur of
``SIGMA_PX``. A finger folded over the palm differs from it by a little shading only, so strength
is relative to what is usual about the pixel (``mean g`` over a neighbourhood) and to the texture
``n`` of the hand's own skin (the median of ``g`` inside it), of which creases are a part::

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
Mask = NDArray[np.bool_]

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
    x, y : (h, w) float32
        Unit direction of the gradient, its sign that of the channel that changes most.
    points, normals : (k, 2) float32
        Edge points in px and their unit gradient direction, sign without meaning.
    point_strength : (k,) float32
        ``strength`` at each point.
    """

    gradient: Float
    strength: Float
    x: Float
    y: Float
    points: Float
    normals: Float
    point_strength: Float

    def __post_init__(self) -> None:
        freeze_arrays(self, copy=False)  # a crop's pictures are made for it alone


def gradients(rgb: Pixels) -> tuple[Float, Float, Float]:
    """Unit gradient x, y and its magnitude ``(h, w)`` of the channel that changes most."""
    soft = cv2.GaussianBlur(rgb.astype(np.float32), (5, 5), SIGMA_PX)
    gx = cv2.Scharr(soft, cv2.CV_32F, 1, 0, scale=1 / 32)
    gy = cv2.Scharr(soft, cv2.CV_32F, 0, 1, scale=1 / 32)
    nx, ny, g = np.zeros((3, *rgb.shape[:2]), np.float32)
    strongest_kernel(gx, gy, nx, ny, g)
    return nx, ny, g


def find_edges(rgb: Pixels, hand: Mask | None = None) -> Edges:
    """Edges of a crop ``(h, w, 3)`` with the hand at ``hand`` ``(h, w)``, if that is known."""
    return edges_of(gradients(rgb), hand)


def edges_of(gradient: tuple[Float, Float, Float], hand: Mask | None = None) -> Edges:
    """Edges of a crop from its :func:`gradients`."""
    nx, ny, g = gradient
    few = g[::3, ::3]
    noise = max(LEAST_NOISE, _quantile(few, 0.25))
    if hand is not None and hand[::3, ::3].sum() > 50:
        noise = max(noise, _quantile(few[hand[::3, ::3]], 0.5))
    usual = np.asarray(cv2.blur(g, (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX)), np.float32)
    strength = np.zeros_like(g)
    strength_kernel(g, usual, np.float32(4 * noise**2), strength)
    index, points, normals, value = thin_kernel(nx, ny, g, strength, WEAK)
    kept = chain_kernel(index, value)
    return Edges(g, strength, nx, ny, points[kept], normals[kept], value[kept])


def _quantile(values: Float, q: float) -> float:
    """The value of that rank; quicker than NumPy's."""
    k = int(q * values.size)
    return float(np.partition(values.ravel(), k)[k])


@numba.njit(cache=True, nogil=True, fastmath=True)
def strongest_kernel(gx, gy, nx, ny, g):  # type: ignore[no-untyped-def]
    """Gradient of the channel that changes most: unit vector and magnitude ``(h, w)``."""
    h, w = g.shape
    for i in range(h):
        for j in range(w):
            best, c = np.float32(1e-12), 0
            for k in range(3):
                square = gx[i, j, k] * gx[i, j, k] + gy[i, j, k] * gy[i, j, k]
                if square > best:
                    best, c = square, k
            length = np.sqrt(best)
            g[i, j] = length
            nx[i, j], ny[i, j] = gx[i, j, c] / length, gy[i, j, c] / length


@numba.njit(cache=True, nogil=True, fastmath=True)
def strength_kernel(g, usual, noise, strength):  # type: ignore[no-untyped-def]
    """The module's ratio; ``noise`` is ``(2 n)^2``."""
    for i in range(g.shape[0]):
        for j in range(g.shape[1]):
            square = g[i, j] * g[i, j]
            rest = noise + np.float32(0.64) * usual[i, j] * usual[i, j]
            strength[i, j] = square / (square + rest)


@numba.njit(cache=True, nogil=True)
def chain_kernel(index, value):  # type: ignore[no-untyped-def]
    """Which points ``(k,)`` are in a chain (8-connected) that is long and somewhere strong.

    ``index`` ``(h, w)`` holds the number of the point in a pixel, or -1.
    """
    n = len(value)
    kept, done = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    chain = np.empty(n, np.int32)
    rows, columns = np.empty(n, np.int32), np.empty(n, np.int32)
    for i in range(index.shape[0]):
        for j in range(index.shape[1]):
            if index[i, j] >= 0:
                rows[index[i, j]], columns[index[i, j]] = i, j
    for start in range(n):
        if done[start]:
            continue
        chain[0], done[start] = start, True
        size, head, best = 1, 0, value[start]
        while head < size:
            i, j = rows[chain[head]], columns[chain[head]]
            head += 1
            for a in range(i - 1, i + 2):
                for b in range(j - 1, j + 2):
                    k = index[a, b]
                    if k >= 0 and not done[k]:
                        done[k] = True
                        best = max(best, value[k])
                        chain[size] = k
                        size += 1
        if size >= MIN_CHAIN_PX and best >= STRONG:
            for k in range(size):
                kept[chain[k]] = True
    return kept


@numba.njit(cache=True, nogil=True, fastmath=True)
def thin_kernel(ux, uy, g, strength, weak):  # type: ignore[no-untyped-def]
    """Maxima of ``g`` across the edge.

    The number of the point in each pixel ``(h, w)`` or -1, points and normals ``(k, 2)``,
    strength ``(k,)``. Two pixels along the crop's border have none.
    """
    h, w = g.shape
    index = np.full((h, w), -1, np.int32)
    value = np.empty(h * w // 2, np.float32)
    points = np.empty((h * w // 2, 2), np.float32)
    normals = np.empty((h * w // 2, 2), np.float32)
    k = 0
    for i in range(2, h - 2):
        for j in range(2, w - 2):
            here = g[i, j]
            if strength[i, j] < weak or here <= 0 or k >= len(points):
                continue
            nx, ny = ux[i, j], uy[i, j]
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
            index[i, j] = k
            value[k] = strength[i, j]
            points[k, 0] = j + shift * sx
            points[k, 1] = i + shift * sy
            normals[k, 0], normals[k, 1] = nx, ny
            k += 1
    return index, points[:k], normals[:k], value[:k]
