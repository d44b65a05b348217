"""The model's outline in the image: distances to it, samples on it, and which of those are seen.

A capsule is the hull of two circles; its outline is two tangents and two arcs. ``frames`` holds
what the distance to each capsule needs, once for all points. Samples hidden behind a nearer capsule
do not vote (the paper's occlusion map, Section 4.2), nor do those where skin goes on.
"""

import numba
import numpy as np

#: Samples along a bone, and the directions (cosine, sine to the bone) of those on its tip.
SIDE_T = np.array([0.2, 0.5, 0.8])
TIP_DIRECTIONS = np.array([[0.0, 1.0], [0.7071, 0.7071], [1.0, 0.0], [0.7071, -0.7071], [0.0, -1]])
#: An outline farther away than this explains nothing.
FARTHEST_PX = 40.0


@numba.njit(cache=True, nogil=True)
def frame_capsules(circles, capsules, frames):  # type: ignore[no-untyped-def]
    """Fill ``frames`` ``(C, 12)``: what the distance to a capsule needs, once for all points.

    Bounding circle x, y, radius; first centre x, y, radius; unit axis x, y; length; tilt of the
    tangent; growth of the radius; ``t`` of the first centre (1 where the second disc holds all).
    """
    for c in range(len(capsules)):
        a, b = circles[capsules[c, 0]], circles[capsules[c, 1]]
        f = frames[c]
        ex, ey, growth = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        length = np.sqrt(ex * ex + ey * ey)
        f[0], f[1] = a[0] + 0.5 * ex, a[1] + 0.5 * ey
        f[2] = 0.5 * length + max(a[2], b[2])
        if length <= abs(growth) + 1e-9:  # one disc holds the other
            first = a if growth <= 0 else b
            f[3], f[4], f[5] = first[0], first[1], first[2]
            f[6:11] = 0.0
            f[8] = 1.0
            f[11] = 0.0 if growth <= 0 else 1.0
        else:
            f[3], f[4], f[5] = a[0], a[1], a[2]
            f[6], f[7], f[8] = ex / length, ey / length, length
            sine = -growth / length
            f[9] = sine / np.sqrt(1.0 - sine * sine)
            f[10], f[11] = growth, 0.0


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")
def framed_distance(x, y, f):  # type: ignore[no-untyped-def]
    """Signed distance, ``t*`` and the vector from the nearest disc's centre to the point."""
    qx, qy = x - f[3], y - f[4]
    foot = qx * f[6] + qy * f[7]
    across = abs(qx * f[7] - qy * f[6])
    t = min(max((foot - across * f[9]) / f[8], 0.0), 1.0)
    mx, my = qx - t * f[8] * f[6], qy - t * f[8] * f[7]
    return np.sqrt(mx * mx + my * my) - (f[5] + t * f[10]), t + f[11], mx, my


@numba.njit(cache=True, nogil=True, fastmath=True)
def nearest_outline(p, facing, among, skip_digit, digit, frames, within):  # type: ignore[no-untyped-def]
    """Nearest capsule outline to an image point ``p`` ``(5,)`` (x, y, normal, weight).

    ``facing``: the capsule nearest from outside whose outline faces as the point's normal; else the
    finger outline nearest from either side, whose outside is the edge's dark side. Signed distance,
    index (-1: none nearer than ``within`` px) and ``t*``; only the capsules ``among``, without
    ``skip_digit``.
    """
    x, y, nx, ny = p[0], p[1], p[2], p[3]
    best, signed, which, t_best = within, within, -1, 0.0
    for c in among:
        if digit[c] == skip_digit or (not facing and digit[c] < 0):
            continue
        f = frames[c]
        dx, dy = x - f[0], y - f[1]
        reach = best + f[2]
        if reach < 0 or dx * dx + dy * dy > reach * reach:
            continue
        d, t, mx, my = framed_distance(x, y, f)
        far = d if facing else abs(d)
        if far < best:
            along = mx * nx + my * ny
            limit = 0.09 if facing else 0.36
            if along > 0 and along * along > limit * (mx * mx + my * my):
                best, signed, which, t_best = far, d, c, t
    return signed, which, t_best


@numba.njit(cache=True, nogil=True)
def sample_of(c, s, circles, capsules, bone):  # type: ignore[no-untyped-def]
    """Outline sample ``s`` of capsule ``c``: t, unit normal; ``(-1, 0, 0)`` past the last."""
    a, b = capsules[c, 0], capsules[c, 1]
    ex, ey = circles[b, 0] - circles[a, 0], circles[b, 1] - circles[a, 1]
    length = np.sqrt(ex * ex + ey * ey)
    if length < 1e-6:
        ex, ey, length = 1.0, 0.0, 1.0
    ex, ey = ex / length, ey / length
    taper = (circles[a, 2] - circles[b, 2]) / length
    if s < 6:
        if abs(taper) >= 1.0:
            return -1.0, 0.0, 0.0
        side = 1.0 if s % 2 == 0 else -1.0
        cross = side * np.sqrt(1.0 - taper * taper)
        return SIDE_T[s // 2], taper * ex - cross * ey, taper * ey + cross * ex
    if bone != 2 or s >= 11:
        return -1.0, 0.0, 0.0
    co, si = TIP_DIRECTIONS[s - 6, 0], TIP_DIRECTIONS[s - 6, 1]
    return 1.0, co * ex - si * ey, co * ey + si * ex


@numba.njit(cache=True, nogil=True, fastmath=True)
def visibility(x, y, z, c, circles, capsules, digit, bone, frames):  # type: ignore[no-untyped-def]
    """0: hidden by a nearer capsule; 1: on the hand's outline; 2: in front of the hand.

    ``z`` is the depth of the sample's axis point. Where skin goes on from bone to bone, or from
    the palm into a finger, there is neither an outline nor an edge.
    """
    margin, seen = 4.0, 1
    for e in range(len(capsules)):
        if e == c:
            continue
        f = frames[e]
        dx, dy = x - f[0], y - f[1]
        if dx * dx + dy * dy > f[2] * f[2]:
            continue
        d, t, _, _ = framed_distance(x, y, f)
        if d > -1.0:
            continue
        near = digit[e] == digit[c] and (digit[c] < 0 or abs(bone[e] - bone[c]) <= 1)
        if near:
            return 0
        a, b = capsules[e, 0], capsules[e, 1]
        behind = circles[a, 3] + t * (circles[b, 3] - circles[a, 3]) - z
        if behind < margin:
            return 0
        seen = 2
    return seen
