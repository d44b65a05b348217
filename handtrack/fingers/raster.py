"""Silhouettes of many hypotheses as bit rows: 128 by 128 pixels in 256 words of 64 bits.

Overlap is then exclusive-or and a population count, tens of thousands of hypotheses a second.
"""

import numba
import numpy as np
from numpy.typing import NDArray

GRID = 128
WORDS = GRID // 64


@numba.njit(cache=True, nogil=True)
def set_span(row, first, last):  # type: ignore[no-untyped-def]
    """Set bits ``first`` to ``last`` (both included, already inside the grid)."""
    for k in range(len(row)):
        a, b = max(first - 64 * k, 0), min(last - 64 * k, 63)
        if a <= b:
            ones = np.uint64(0xFFFFFFFFFFFFFFFF)
            row[k] |= (ones << np.uint64(a)) & (ones >> np.uint64(63 - b))


@numba.njit(cache=True, nogil=True)
def fill_convex(rows, corners, scale):  # type: ignore[no-untyped-def]
    """Fill a convex polygon ``(V, 2)`` of window pixels, ``scale`` grid cells to a pixel."""
    n, size = len(corners), len(rows)
    low, high = corners[:, 1].min(), corners[:, 1].max()
    top = max(int(np.ceil((low + 0.5) * scale - 0.5)), 0)
    bottom = min(int(np.floor((high + 0.5) * scale - 0.5)), size - 1)
    for i in range(top, bottom + 1):
        y = (i + 0.5) / scale - 0.5
        left, right = 1e9, -1e9
        for a in range(n):
            b = a + 1 if a + 1 < n else 0
            ya, yb = corners[a, 1], corners[b, 1]
            if (ya <= y) == (yb <= y) and ya != y:
                continue
            x = corners[a, 0]
            if yb != ya:
                x += (y - ya) / (yb - ya) * (corners[b, 0] - corners[a, 0])
            left, right = min(left, x), max(right, x)
        first = max(int(np.ceil((left + 0.5) * scale - 0.5)), 0)
        last = min(int(np.floor((right + 0.5) * scale - 0.5)), size - 1)
        if first <= last:
            set_span(rows[i], first, last)


@numba.njit(cache=True, nogil=True, inline="always")
def popcount(x):  # type: ignore[no-untyped-def]
    """Number of set bits of a 64-bit word."""
    x -= (x >> np.uint64(1)) & np.uint64(0x5555555555555555)
    x = (x & np.uint64(0x3333333333333333)) + (
        (x >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )  # fmt: skip
    x = (x + (x >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (x * np.uint64(0x0101010101010101)) >> np.uint64(56)


@numba.njit(cache=True, nogil=True)
def overlaps(corners, scale, evidence, ignored, counts):  # type: ignore[no-untyped-def]
    """Areas in grid cells ``(n, 3)``: of the model, of the exclusive-or, of the evidence.

    ``evidence`` and ``ignored`` are bit rows ``(GRID, WORDS)``; ignored cells count nowhere.
    """
    rows = np.empty_like(evidence)
    for n in range(len(corners)):
        rows[:] = 0
        for p in range(corners.shape[1]):
            fill_convex(rows, corners[n, p], scale)
        model, differ, seen = 0, 0, 0
        for i in range(rows.shape[0]):
            for k in range(rows.shape[1]):
                care = ~ignored[i, k]
                model += popcount(rows[i, k] & care)
                differ += popcount((rows[i, k] ^ evidence[i, k]) & care)
                seen += popcount(evidence[i, k] & care)
        counts[n, 0], counts[n, 1], counts[n, 2] = model, differ, seen


def pack_bits(mask: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Bit rows ``(GRID, WORDS)`` of a mask ``(GRID, GRID)``.

    >>> mask = np.zeros((GRID, GRID), bool)
    >>> mask[3, 65] = True
    >>> int(pack_bits(mask)[3, 1])
    2
    """
    bits = np.packbits(mask.reshape(GRID, WORDS, 64), axis=-1, bitorder="little")
    return bits.reshape(GRID, WORDS, 8).copy().view("<u8")[..., 0].astype(np.uint64)
