"""The energy that refinement lowers, with its Gauss-Newton system, in one pass.

Unknowns are a palm increment and the angles, ``x = (w, v, theta)``: ``R <- exp(w) R``,
``t <- t + v`` (26 numbers). With robust ``rho(r) = c^2 r^2 / (c^2 + r^2)`` (Geman and McClure)::

    E = [ sum contour rho(d(p))               image -> nearest compatible capsule
        + a sum silhouette rho(sdf)            model outline -> image outline
        + b sum internal rho(k)                fingers before the hand -> edges on their normal
        + e sum creases s rho(d(p))            edges inside the silhouette -> nearest finger
        ] / sigma^2
        + (theta - mu)' P (theta - mu) + |temporal|^2 + |limits|^2

Image to model and model to image are both needed: either alone is blind to what the other shows
(a finger that is not there, a finger that is not modelled). Samples hidden behind a nearer
capsule do not vote (the paper's occlusion map, Section 4.2).
"""

import numba
import numpy as np

from handtrack.hand.kinematics import jacobian_kernel, keypoints_kernel

#: Samples along a bone, and the directions (cosine, sine to the bone) of those on its tip.
SIDE_T = np.array([0.2, 0.5, 0.8])
TIP_DIRECTIONS = np.array([[0.0, 1.0], [0.7071, 0.7071], [1.0, 0.0], [0.7071, -0.7071], [0.0, -1]])
#: An outline farther away than this explains nothing.
FARTHEST_PX = 40.0


@numba.njit(cache=True, nogil=True)
def place_nodes(theta, R, t, hand, K, circles, Jc):  # type: ignore[no-untyped-def]
    """Fill ``circles`` ``(n, 4)`` (x, y, radius px, depth mm) and their derivatives.

    ``Jc`` ``(n, 3, 10)``: of x, y, radius by the six pose numbers and the digit's four angles.
    ``hand`` is ``(base, rest, length, node_from, node_weight, node_offset, node_radius, digit)``.
    """
    base, rest, length, node_from, node_weight, node_offset, node_radius, digit = hand
    points = np.zeros((21, 3))
    J = np.zeros((21, 3, 20))
    jacobian_kernel(theta, base, rest, length, points, J)
    fx, fy, cx, cy = K[0], K[1], K[2], K[3]
    X = np.empty(3)
    P = np.empty(3)
    dX = np.zeros((3, 10))
    for n in range(len(node_weight)):
        i, j, w = node_from[n, 0], node_from[n, 1], node_weight[n]
        for a in range(3):
            P[a] = (1 - w) * points[i, a] + w * points[j, a] + node_offset[n, a]
        for a in range(3):
            X[a] = R[a, 0] * P[0] + R[a, 1] * P[1] + R[a, 2] * P[2]
        # d exp(w) X / dw = -[X]x, with X the rotated point before translation
        dX[:] = 0.0
        dX[0, 1], dX[0, 2] = X[2], -X[1]
        dX[1, 0], dX[1, 2] = -X[2], X[0]
        dX[2, 0], dX[2, 1] = X[1], -X[0]
        for a in range(3):
            dX[a, 3 + a] = 1.0
            X[a] += t[a]
        if digit[n] >= 0:
            for q in range(4):
                c = 4 * digit[n] + q
                for a in range(3):
                    s = 0.0
                    for b in range(3):
                        s += R[a, b] * ((1 - w) * J[i, b, c] + w * J[j, b, c])
                    dX[a, 6 + q] = s
        z = max(X[2], 10.0)
        circles[n, 0] = fx * X[0] / z + cx
        circles[n, 1] = fy * X[1] / z + cy
        circles[n, 2] = fx * node_radius[n] / z
        circles[n, 3] = z
        for q in range(10):
            Jc[n, 0, q] = fx * (dX[0, q] - X[0] / z * dX[2, q]) / z
            Jc[n, 1, q] = fy * (dX[1, q] - X[1] / z * dX[2, q]) / z
            Jc[n, 2, q] = -circles[n, 2] / z * dX[2, q]


@numba.njit(cache=True, nogil=True)
def place_digit(theta, d, R, t, hand, K, circles):  # type: ignore[no-untyped-def]
    """Update the circles ``(n, 4)`` of the nodes that digit ``d`` moves; ``theta`` ``(1, 20)``."""
    base, rest, length, node_from, node_weight, node_offset, node_radius, digit = hand
    points = np.empty((1, 21, 3))
    keypoints_kernel(theta, base, rest, length, points)
    X = np.empty(3)
    for n in range(len(node_weight)):
        if digit[n] != d:
            continue
        i, j, w = node_from[n, 0], node_from[n, 1], node_weight[n]
        for a in range(3):
            X[a] = t[a]
            for b in range(3):
                P = (1 - w) * points[0, i, b] + w * points[0, j, b] + node_offset[n, b]
                X[a] += R[a, b] * P
        z = max(X[2], 10.0)
        circles[n, 0] = K[0] * X[0] / z + K[2]
        circles[n, 1] = K[1] * X[1] / z + K[3]
        circles[n, 2] = K[0] * node_radius[n] / z
        circles[n, 3] = z


@numba.njit(cache=True, nogil=True, inline="always")
def rho(r, c2):  # type: ignore[no-untyped-def]
    """Geman and McClure's robust function, saturating at ``c2``."""
    return c2 * r * r / (c2 + r * r)


@numba.njit(cache=True, nogil=True)
def add_row(H, g, row, digit, r, weight):  # type: ignore[no-untyped-def]
    """Add one residual with derivative ``row`` ``(10,)`` to the normal equations."""
    n = 10 if digit >= 0 else 6
    for a in range(n):
        ia = a if a < 6 else 6 + 4 * digit + a - 6
        wa = weight * row[a]
        g[ia] += wa * r
        for b in range(n):
            ib = b if b < 6 else 6 + 4 * digit + b - 6
            H[ia, ib] += wa * row[b]


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


@numba.njit(cache=True, nogil=True, inline="always")
def bilinear(image, x, y):  # type: ignore[no-untyped-def]
    """Value of ``image`` at ``(x, y)``, which must lie at least a pixel inside."""
    i, j = int(y), int(x)
    fy, fx = y - i, x - j
    return (1 - fy) * ((1 - fx) * image[i, j] + fx * image[i, j + 1]) + fy * (
        (1 - fx) * image[i + 1, j] + fx * image[i + 1, j + 1]
    )


@numba.njit(cache=True, nogil=True, fastmath=True)
def search_edge(x, y, nx, ny, reach, strength, edge_x, edge_y):  # type: ignore[no-untyped-def]
    """Best edge along the normal, dark outside: strength (0 if none) and offset in px."""
    h, w = strength.shape
    best, offset = 0.0, 0.0
    for k in range(-reach, reach + 1):
        i, j = int(y + k * ny + 0.5), int(x + k * nx + 0.5)
        if i < 0 or j < 0 or i >= h or j >= w:
            continue
        s = strength[i, j]
        if s > 0.05:
            s *= max(edge_x[i, j] * nx + edge_y[i, j] * ny, 0.0) ** 4
            s *= 1.0 - abs(k) / (reach + 1.0)
            if s > best:
                best, offset = s, k
    return min(best / (1.0 - abs(offset) / (reach + 1.0)), 1.0), offset


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


@numba.njit(cache=True, nogil=True)
def sample_energy(c, circles, capsules, digit, bone, frames, view, weights, Jc, H, g):  # type: ignore[no-untyped-def]
    """Energy of capsule ``c``'s outline samples; adds to ``H``, ``g`` unless they are empty."""
    sdf, strength, edge_x, edge_y, valid = view
    c2, silhouette, internal, reach = weights[1], weights[2], weights[3], int(weights[4])
    energy = 0.0
    row = np.zeros(10)
    a, b = capsules[c, 0], capsules[c, 1]
    for s in range(11):
        t, nx, ny = sample_of(c, s, circles, capsules, bone[c])
        if t < 0.0:
            break
        radius = circles[a, 2] + t * (circles[b, 2] - circles[a, 2])
        x = circles[a, 0] + t * (circles[b, 0] - circles[a, 0]) + radius * nx
        y = circles[a, 1] + t * (circles[b, 1] - circles[a, 1]) + radius * ny
        if x < valid[0] + 1 or y < valid[1] + 1 or x > valid[2] - 2 or y > valid[3] - 2:
            continue
        z = circles[a, 3] + t * (circles[b, 3] - circles[a, 3])
        seen = visibility(x, y, z, c, circles, capsules, digit, bone, frames)
        if seen == 0:
            continue
        gx, gy = nx, ny
        if seen == 1:
            r = bilinear(sdf, x, y)
            weight = silhouette
            gx = 0.5 * (bilinear(sdf, x + 1, y) - bilinear(sdf, x - 1, y))
            gy = 0.5 * (bilinear(sdf, x, y + 1) - bilinear(sdf, x, y - 1))
            energy += weight * rho(r, c2)
        else:
            found, k = search_edge(x, y, nx, ny, reach, strength, edge_x, edge_y)
            r, weight = -float(k), internal * found
            energy += weight * rho(r, c2) + internal * (1.0 - found) * rho(float(reach), c2)
        if len(g) and weight > 0:
            for q in range(10):
                jx = (1 - t) * Jc[a, 0, q] + t * Jc[b, 0, q]
                jy = (1 - t) * Jc[a, 1, q] + t * Jc[b, 1, q]
                jr = (1 - t) * Jc[a, 2, q] + t * Jc[b, 2, q]
                row[q] = gx * (jx + nx * jr) + gy * (jy + ny * jr)
            robust = c2 / (c2 + r * r)
            add_row(H, g, row, digit[c], r, weight * robust * robust)
    return energy


@numba.njit(cache=True, nogil=True)
def distance_row(row, p, c, t, circles, capsules, Jc):  # type: ignore[no-untyped-def]
    """Fill ``row`` ``(10,)``: derivative of the distance of ``p`` to capsule ``c`` at ``t*``."""
    a, b = capsules[c, 0], capsules[c, 1]
    mx = p[0] - circles[a, 0] - t * (circles[b, 0] - circles[a, 0])
    my = p[1] - circles[a, 1] - t * (circles[b, 1] - circles[a, 1])
    norm = max(np.sqrt(mx * mx + my * my), 1e-6)
    mx, my = mx / norm, my / norm
    for q in range(10):
        row[q] = -(
            mx * ((1 - t) * Jc[a, 0, q] + t * Jc[b, 0, q])
            + my * ((1 - t) * Jc[a, 1, q] + t * Jc[b, 1, q])
            + (1 - t) * Jc[a, 2, q]
            + t * Jc[b, 2, q]
        )


@numba.njit(cache=True, nogil=True)
def image_energy(  # type: ignore[no-untyped-def]
    circles, capsules, digit, bone, contour, inner, view, weights, Jc, H, g
):
    """The image part of ``E``, already over ``sigma^2``; fills ``H``, ``g`` unless empty.

    ``contour`` and ``inner`` ``(m, 5)``: x, y, normal, weight. ``weights``: sigma, c^2,
    silhouette, internal, reach.
    """
    c2 = weights[1]
    energy = 0.0
    row = np.zeros(10)
    frames = np.empty((len(capsules), 12))
    frame_capsules(circles, capsules, frames)
    every = np.arange(len(capsules))
    for k in range(len(contour) + len(inner)):
        on_outline = k < len(contour)
        point = contour[k] if on_outline else inner[k - len(contour)]
        w = point[4]
        if w <= 0:
            continue
        d, c, t = nearest_outline(point, on_outline, every, -9, digit, frames, FARTHEST_PX)
        if c < 0:
            energy += w * c2
            continue
        energy += w * rho(d, c2)
        if len(g):
            distance_row(row, point, c, t, circles, capsules, Jc)
            robust = c2 / (c2 + d * d)
            add_row(H, g, row, digit[c], d, w * robust * robust)
    for c in range(len(capsules)):
        if bone[c] > -2:
            energy += sample_energy(
                c, circles, capsules, digit, bone, frames, view, weights, Jc, H, g
            )
    scale = 1.0 / (weights[0] * weights[0])
    if len(g):
        H *= scale
        g *= scale
    return energy * scale
