"""What colours the hand has, and what colours everything else has: two smoothed 3-D histograms.

A colour ``x`` is luma and two chroma (YCrCb; chroma spread by two, since nothing ordinary is more
saturated). ``f(x)`` and ``b(x)`` are densities of hand and background on a grid of 32^3 bins, both
with a floor for colours never seen, which lean to background::

    log f(x) - log b(x)        (interpolated between bins, so the outline stays smooth)

A surface in the shade keeps its chroma *ratio*: every sample is also counted, with less weight, as
it would look dimmed, so that a shadow on the wall is wall and a shaded palm is hand.

The model follows the clip slowly: what is looked up is a mixture of the histograms it started with
(the *anchor*, half of it for ever) and a running mean, so a tracker that is wrong for a second
cannot talk it into something else.

>>> hand = np.full((40, 3), (200, 140, 120), np.uint8)
>>> wall = np.full((40, 3), (120, 125, 130), np.uint8)
>>> model = ColourModel.from_samples(hand, wall)
>>> bool(model.log_odds(hand[:1])[0] > 3), bool(model.log_odds(wall[:1] // 2)[0] < -1)
(True, True)
"""

from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]

N_BINS = 32
#: The anchor's share of the model for ever.
ANCHOR = 0.5
#: Probability mass spread over colours never seen: of hand, of background.
UNSEEN = (0.01, 0.04)
#: Log odds of the anchor against which nothing is learned.
FIRM = 2.0
#: How a surface is also counted dimmed: factors and the weight of each.
SHADES = np.array([[1.0, 1.0], [0.85, 0.12], [0.7, 0.08], [0.55, 0.05]])
_VOLUME = 0.1  # share of the grid's bins that pictures use


class ColourModel:
    """Densities of the colours of hand and background; :meth:`learn` moves them slowly.

    Attributes
    ----------
    table : (32, 32, 32, 2) float32
        Densities per bin of hand and background.
    shadows : bool
        The dimmed background counts as background.
    gain : (3,) float32
        Red, green and blue are multiplied by this first: a dim clip is brightened, so that it fills
        the bins, and a change of the light since then is taken back (:meth:`relight`).
    """

    def __init__(
        self, hand: Float, background: Float, shadows: bool = True, gain: float = 1.0
    ) -> None:
        self.gain: Float = np.full(3, gain, np.float32)
        self._first_gain = gain
        self.shadows = shadows
        self._anchor = np.stack([hand, background], axis=-1)
        self._running = self._anchor.copy()
        self._anchor_table = _with_floor(self._anchor)
        self.table: Float = self._anchor_table

    @classmethod
    def from_samples(
        cls,
        hand: Pixels,
        background: Pixels,
        hand_weight: Float | None = None,
        background_weight: Float | None = None,
        shadows: bool = True,
    ) -> "ColourModel":
        """A model of RGB samples ``(n, 3)``, weighted ``(n,)`` if wanted.

        Without ``shadows``, the background is not also counted dimmed.
        """
        gain = _gain_of(hand, background)
        f = histogram(brightened(hand, gain), hand_weight)
        shades = SHADES if shadows else SHADES[:1]
        b = histogram(brightened(background, gain), background_weight, shades)
        return cls(f, b, shadows, gain)

    def relight(self, light: Float) -> None:
        """The light on everything is now ``light`` ``(3,)`` times that of the first samples."""
        self.gain = np.asarray(self._first_gain / light, np.float32)

    def learn(self, hand: Pixels, background: Pixels, rate: float) -> None:
        """Move the running histograms by ``rate`` (0 to 1) towards RGB samples ``(n, 3)``.

        What the anchor firmly calls the opposite is not learned: a sleeve is no hand, however often
        the model of a forearm is laid over it.
        """
        hand, background = brightened(hand, self.gain), brightened(background, self.gain)
        hand = hand[_log_odds(hand, self._anchor_table) > -FIRM]
        background = background[_log_odds(background, self._anchor_table) < FIRM]
        wall_shades = SHADES if self.shadows else SHADES[:1]
        for k, (samples, shades) in enumerate(((hand, SHADES), (background, wall_shades))):
            if len(samples) >= 30:
                now = histogram(samples, shades=shades)
                self._running[..., k] += rate * (now - self._running[..., k])
        self._rebuild()

    def log_odds(self, rgb: Pixels) -> Float:
        """``log f - log b`` of RGB pixels ``(..., 3)``, as float32 ``(...)``."""
        return _log_odds(brightened(rgb, self.gain), self.table)

    def _rebuild(self) -> None:
        self.table = _with_floor(ANCHOR * self._anchor + (1 - ANCHOR) * self._running)


def brightened(rgb: Pixels, gain: Float | float) -> Pixels:
    """RGB ``(..., 3)`` times ``gain``, one number or ``(3,)``.

    >>> brightened(np.full((1, 3), 100, np.uint8), np.array([1, 1.5, 3], np.float32)).tolist()
    [[100, 150, 255]]
    """
    if rgb.size == 0 or np.all(np.asarray(gain) == 1.0):
        return rgb
    table = np.arange(256)[:, None] * np.broadcast_to(gain, 3)
    table = np.clip(np.rint(table), 0, 255).astype(np.uint8)[None]
    flat = np.ascontiguousarray(rgb).reshape(-1, 1, 3)
    return np.asarray(cv2.LUT(flat, table), np.uint8).reshape(rgb.shape)


def largest_channel(picture: NDArray[Any]) -> NDArray[Any]:
    """The largest of three channels ``(..., 3)``; NumPy's own is slow along so short an axis."""
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])


def _gain_of(hand: Pixels, background: Pixels) -> float:
    """What brings the brightest colours near white, 1 to 5; 1 unless the clip is really dim."""
    if len(hand) == 0 or len(background) == 0:
        return 1.0
    bright = max(float(np.quantile(largest_channel(part), 0.98)) for part in (hand, background))
    gain = min(230 / max(bright, 1.0), 5.0)
    return gain if gain > 1.3 else 1.0


def _with_floor(densities: Float) -> Float:
    """Densities ``(32, 32, 32, 2)`` with the share of colours never seen."""
    unseen = np.array(UNSEEN, np.float32)
    return np.asarray(densities * (1 - unseen) + unseen / (_VOLUME * N_BINS**3), np.float32)


def _log_odds(rgb: Pixels, table: Float) -> Float:
    """Log odds ``(...)`` of RGB pixels ``(..., 3)`` by a table of densities."""
    ycc = to_ycc(rgb).reshape(-1, 3)
    out = np.empty(len(ycc), np.float32)
    log_odds_kernel(ycc, table, out)
    return out.reshape(rgb.shape[:-1])


def to_ycc(rgb: Pixels) -> Pixels:
    """YCrCb ``(..., 3)`` of RGB ``(..., 3)``, both uint8; of no pixels, none."""
    if rgb.size == 0:
        return rgb
    flat = np.ascontiguousarray(rgb).reshape(1, -1, 3)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2YCrCb), np.uint8).reshape(rgb.shape)


def histogram(
    rgb: Pixels, weight: Float | None = None, shades: NDArray[np.float64] = SHADES
) -> Float:
    """Smoothed histogram ``(32, 32, 32)`` of RGB samples ``(n, 3)``, summing to one."""
    counts = np.zeros((N_BINS, N_BINS, N_BINS), np.float32)
    if len(rgb) == 0:
        return np.full_like(counts, 1 / counts.size)
    w = np.ones(len(rgb), np.float32) if weight is None else weight.astype(np.float32)
    splat_kernel(to_ycc(rgb), w, shades, counts)
    smooth_kernel(counts)
    return counts / max(float(counts.sum()), 1e-12)


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy", forceinline=True)
def bin_position(y, cr, cb):  # type: ignore[no-untyped-def]
    """Continuous bin coordinates of a YCrCb colour."""
    top, zero = np.float32(N_BINS - 1.001), np.float32(0)
    step, middle, grey = (
        np.float32((N_BINS - 1) / 255),
        np.float32((N_BINS - 1) / 2),
        np.float32(128),
    )
    i = min(max(np.float32(y) * step, zero), top)
    j = min(max((np.float32(cr) - grey) * 2 * step + middle, zero), top)
    k = min(max((np.float32(cb) - grey) * 2 * step + middle, zero), top)
    return i, j, k


@numba.njit(cache=True, nogil=True, fastmath=True)
def splat_kernel(ycc, weight, shades, counts):  # type: ignore[no-untyped-def]
    """Add each sample, and its dimmed copies, to the eight bins about it."""
    for n in range(ycc.shape[0]):
        for m in range(shades.shape[0]):
            a = shades[m, 0]
            i, j, k = bin_position(
                ycc[n, 0] * a, 128 + (ycc[n, 1] - 128.0) * a, 128 + (ycc[n, 2] - 128.0) * a
            )
            i0, j0, k0 = int(i), int(j), int(k)
            w = weight[n] * shades[m, 1]
            for di in range(2):
                wi = w * (i - i0 if di else 1 - (i - i0))
                for dj in range(2):
                    wj = wi * (j - j0 if dj else 1 - (j - j0))
                    for dk in range(2):
                        wk = wj * (k - k0 if dk else 1 - (k - k0))
                        counts[i0 + di, j0 + dj, k0 + dk] += wk


@numba.njit(cache=True, nogil=True, fastmath=True)
def smooth_kernel(counts):  # type: ignore[no-untyped-def]
    """Smooth in place by (1 2 1)/4 along each axis, luma once more than chroma."""
    n = counts.shape[0]
    for _ in range(2):
        smooth_rows(counts.reshape(n, n * n))
    for a in range(n):
        smooth_rows(counts[a])
        for b in range(n):
            smooth_rows(counts[a, b].reshape(n, 1))


@numba.njit(cache=True, nogil=True, fastmath=True)
def smooth_rows(table):  # type: ignore[no-untyped-def]
    """Smooth a table ``(n, m)`` in place by (1 2 1)/4 along its first axis; beyond it is zero."""
    n, m = table.shape
    previous = np.zeros(m, np.float32)
    for c in range(n):
        for k in range(m):
            here = table[c, k]
            after = table[c + 1, k] if c + 1 < n else np.float32(0.0)
            table[c, k] = 0.25 * previous[k] + 0.5 * here + 0.25 * after
            previous[k] = here


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy", forceinline=True)
def densities(table, y, cr, cb):  # type: ignore[no-untyped-def]
    """Interpolated densities of hand and background at a YCrCb colour."""
    i, j, k = bin_position(y, cr, cb)
    i0, j0, k0 = int(i), int(j), int(k)
    u, v, w = i - np.float32(i0), j - np.float32(j0), k - np.float32(k0)
    f, b, one = np.float32(0), np.float32(0), np.float32(1)
    for di in range(2):
        wi = u if di else one - u
        for dj in range(2):
            wj = wi * (v if dj else one - v)
            near, far = wj * (one - w), wj * w
            m, n = i0 + di, j0 + dj
            f += near * table[m, n, k0, 0] + far * table[m, n, k0 + 1, 0]
            b += near * table[m, n, k0, 1] + far * table[m, n, k0 + 1, 1]
    return f, b


@numba.njit(cache=True, nogil=True, fastmath=True)
def log_odds_kernel(ycc, table, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` ``(n,)`` for ``ycc`` ``(n, 3)``."""
    for n in range(ycc.shape[0]):
        f, b = densities(table, ycc[n, 0], ycc[n, 1], ycc[n, 2])
        out[n] = np.log(f / b)
