"""The arithmetic of the silhouette: log odds of every pixel, compiled.

Formulas in :mod:`handtrack.evidence.silhouette`. Every second pixel of every second row is worked
out; of the others only those among which the picture is undecided or changes (the outline, gaps
between fingers, shades), and the sure rest is filled in between.

>>> ycc = np.full((8, 8, 3), 128, np.uint8)
>>> table = np.ones((32, 32, 32, 2), np.float32)
>>> table[..., 0] = np.e
>>> log_odds_image(ycc, ycc, table, None, 0.0).round(4).max().item()
1.0
"""

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.evidence.colour import densities

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]

#: Log odds beyond which a pixel is sure, and at which they are clipped.
SURE, MOST = 4.0, 6.0
#: Share ``w`` of the local background where it is known.
LOCAL_SHARE = 0.95
_BIN_VOLUME_RGB = 589.0  # RGB volume of one bin of the colour model


def log_odds_image(
    rgb: Pixels,
    ycc: Pixels,
    table: Float,
    local: Float | None,
    shadow_share: float,
    gain: float = 1.0,
) -> Float:
    """Log odds ``(h, w)`` of a crop, clipped to ``MOST``.

    Parameters
    ----------
    rgb, ycc : (h, w, 3)
        The crop in both colour spaces, ``ycc`` as bright as the table wants it.
    table : (32, 32, 32, 2)
        Densities per bin of hand and background.
    local : (h, w, 4), optional
        The background's mean and standard deviation at each pixel; the deviation is above
        1000 where it is not known.
    shadow_share : float
        Share of shadows in the local background.
    gain : float
        By which ``ycc`` is brighter than ``rgb``.
    """
    out = np.empty(rgb.shape[:2], np.float32)
    wall = np.zeros((0, 0, 4), np.float32) if local is None else local
    volume = np.float32(_BIN_VOLUME_RGB / gain**3)
    log_odds_kernel(rgb, ycc, table, wall, np.float32(shadow_share), volume, out)
    return out


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def log_odds_kernel(rgb, ycc, table, local, shadow_share, volume, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` ``(h, w)``; ``local`` may be empty."""
    h, w = out.shape
    for i in range(0, h, 2):
        for j in range(0, w, 2):
            out[i, j] = pixel(rgb, ycc, table, local, shadow_share, volume, i, j)
    last_row, last_column = (h - 1) - (h - 1) % 2, (w - 1) - (w - 1) % 2
    for i in range(h):
        top = i - i % 2
        bottom = min(top + 2, last_row)
        for j in range(1 - i % 2, w, 2 - i % 2):
            left = j - j % 2
            right = min(left + 2, last_column)
            a, b, c, d = out[top, left], out[top, right], out[bottom, left], out[bottom, right]
            if min(a, b, c, d) > SURE or max(a, b, c, d) < -SURE:
                out[i, j] = np.float32(0.25) * (a + b + c + d)
            else:
                out[i, j] = pixel(rgb, ycc, table, local, shadow_share, volume, i, j)


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy", forceinline=True)
def pixel(rgb, ycc, table, local, shadow_share, volume, i, j):  # type: ignore[no-untyped-def]
    """Log odds at one pixel."""
    f, b = densities(table, ycc[i, j, 0], ycc[i, j, 1], ycc[i, j, 2])
    if local.shape[0] > 0 and local[i, j, 3] < np.float32(1e3):
        wall = wall_density(rgb, local, shadow_share, volume, i, j)
        b = np.float32(1 - LOCAL_SHARE) * b + np.float32(LOCAL_SHARE) * wall
    return min(max(np.log(f / b), np.float32(-MOST)), np.float32(MOST))


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy", forceinline=True)
def wall_density(rgb, local, shadow_share, volume, i, j):  # type: ignore[no-untyped-def]
    """Density per bin of what stands behind this pixel, plain or in the shade.

    Where the background changes from pixel to pixel its deviation is larger: the camera
    trembles, and the model of it is coarser than the picture.
    """
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    right, below = min(j + 1, local.shape[1] - 1), min(i + 1, local.shape[0] - 1)
    d2, x_mu, mu_mu, x_x, slope = zero, zero, np.float32(1e-6), zero, zero
    for c in range(3):
        x, mu = np.float32(rgb[i, j, c]), local[i, j, c]
        d2 += (x - mu) * (x - mu)
        x_mu += x * mu
        mu_mu += mu * mu
        x_x += x * x
        gx, gy = local[i, right, c] - mu, local[below, j, c] - mu
        slope += gx * gx + gy * gy
    s2 = local[i, j, 3] * local[i, j, 3] + np.float32(0.1) * slope
    density = zero
    if d2 < 40 * s2:
        density = min(one, volume / (np.float32(15.75) * s2 * np.sqrt(s2))) * np.exp(
            -half * d2 / s2
        )
    a = min(max(x_mu / mu_mu, half), one)
    off = x_x - 2 * a * x_mu + a * a * mu_mu  # squared distance to the ray of its shades
    if shadow_share > 0 and off < 40 * s2:
        ridge = min(one, volume / (np.float32(6.28) * s2 * half * np.sqrt(mu_mu)))
        density += shadow_share * ridge * np.exp(-half * max(off, zero) / s2)
    return density
