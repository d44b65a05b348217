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
(a finger that is not there, a finger that is not modelled).
"""

import numba
import numpy as np

from handtrack.hand.kinematics import jacobian_kernel, keypoints_kernel
from handtrack.refine.outline import (
    FARTHEST_PX,
    frame_capsules,
    nearest_outline,
    sample_of,
    visibility,
)


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
