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
def fill_capsule(rows, first, second, scale):  # type: ignore[no-untyped-def]
    """Fill the hull of two circles ``(x, y, r, ..)`` of window pixels."""
    size = len(rows)
    ax, ay, ar, bx, by, br = first[0], first[1], first[2], second[0], second[1], second[2]
    ex, ey = bx - ax, by - ay
    length = np.sqrt(ex * ex + ey * ey)
    tangents = length > abs(ar - br) + 1e-9
    quad = np.empty((4, 2))
    if tangents:
        ex, ey = ex / length, ey / length
        taper = (ar - br) / length
        cross = np.sqrt(1.0 - taper * taper)
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            nx = taper * ex - sign * cross * ey
            ny = taper * ey + sign * cross * ex
            near, far = (0, 1) if side == 0 else (3, 2)
            quad[near, 0], quad[near, 1] = ax + ar * nx, ay + ar * ny
            quad[far, 0], quad[far, 1] = bx + br * nx, by + br * ny
    low, high = min(ay - ar, by - br), max(ay + ar, by + br)
    top = max(int(np.ceil((low + 0.5) * scale - 0.5)), 0)
    bottom = min(int(np.floor((high + 0.5) * scale - 0.5)), size - 1)
    for i in range(top, bottom + 1):
        y = (i + 0.5) / scale - 0.5
        left, right = 1e9, -1e9
        if abs(y - ay) < ar:
            half = np.sqrt(ar * ar - (y - ay) ** 2)
            left, right = ax - half, ax + half
        if abs(y - by) < br:
            half = np.sqrt(br * br - (y - by) ** 2)
            left, right = min(left, bx - half), max(right, bx + half)
        if tangents:
            for a in range(4):
                b = (a + 1) % 4
                ya, yb = quad[a, 1], quad[b, 1]
                if (ya <= y) != (yb <= y):
                    x = quad[a, 0] + (y - ya) / (yb - ya) * (quad[b, 0] - quad[a, 0])
                    left, right = min(left, x), max(right, x)
        first_bit = max(int(np.ceil((left + 0.5) * scale - 0.5)), 0)
        last_bit = min(int(np.floor((right + 0.5) * scale - 0.5)), size - 1)
        if first_bit <= last_bit:
            set_span(rows[i], first_bit, last_bit)


@numba.njit(cache=True, nogil=True)
def compare(rows, below, evidence, outside, out):  # type: ignore[no-untyped-def]
    """Areas of the model, of the difference and of the evidence, where cells count."""
    model, differ, seen = 0, 0, 0
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            care = ~(outside[i, k] | below[i, k])
            model += popcount(rows[i, k] & care)
            differ += popcount((rows[i, k] ^ evidence[i, k]) & care)
            seen += popcount(evidence[i, k] & care)
    out[0], out[1], out[2] = model, differ, seen


@numba.njit(cache=True, nogil=True)
def polygon_areas(corners, below, scale, evidence, outside, counts):  # type: ignore[no-untyped-def]
    """Areas in grid cells ``(n, 3)`` of polygons ``(n, P, V, 2)``: model, difference, evidence.

    ``below`` ``(4, 2)`` is a quadrilateral that counts nowhere; ``evidence`` and ``outside`` are
    bit rows ``(GRID, WORDS)``.
    """
    rows = np.zeros_like(evidence)
    ignored = np.zeros_like(evidence)
    fill_convex(ignored, below, scale)
    for n in range(len(corners)):
        rows[:] = 0
        for p in range(corners.shape[1]):
            fill_convex(rows, corners[n, p], scale)
        compare(rows, ignored, evidence, outside, counts[n])


@numba.njit(cache=True, nogil=True)
def capsule_areas(circles, capsules, below, scale, evidence, outside, counts):  # type: ignore[no-untyped-def]
    """The same of capsules: circles ``(n, K, 4)``, and one ``below`` ``(n, 4, 2)`` each."""
    rows = np.zeros_like(evidence)
    ignored = np.zeros_like(evidence)
    for n in range(len(circles)):
        rows[:] = 0
        ignored[:] = 0
        fill_convex(ignored, below[n], scale)
        for c in range(len(capsules)):
            fill_capsule(rows, circles[n, capsules[c, 0]], circles[n, capsules[c, 1]], scale)
        compare(rows, ignored, evidence, outside, counts[n])


def pack_bits(mask: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Bit rows ``(GRID, WORDS)`` of a mask ``(GRID, GRID)``.

    >>> mask = np.zeros((GRID, GRID), bool)
    >>> mask[3, 65] = True
    >>> int(pack_bits(mask)[3, 1])
    2
    """
    bits = np.packbits(mask.reshape(GRID, WORDS, 64), axis=-1, bitorder="little")
    return bits.reshape(GRID, WORDS, 8).copy().view("<u8")[..., 0].astype(np.uint64)
