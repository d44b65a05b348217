"""Light and shadow, vertex by vertex.

A lit vertex sends back ``albedo (ambient O + sum_l I_l V_l wrap(n . l)) + gloss``, with a Lambert
term that wraps a little round the edge, as light does in skin. ``V`` is the share of the lamp that
is not hidden: a depth map of the hand as the lamp sees it, compared over 3 x 3 cells. ``O`` is the
same for light from everywhere, the mean over a few directions: it darkens the clefts between
fingers and where a finger touches the palm.

Shading is done here and not by pyrender's own shader because the skin's triangles are about a
pixel in size: Mesa shades 4 x 4 blocks per triangle, which takes 200 ms a frame on a CPU, while
vertices take 20.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from synth.scene import Light, Look

Array = NDArray[np.float64]

_WRAP = 0.15
_GLOSS, _GLOSS_POWER = 0.05, 18.0
_CELL_MM = 1.5
_BIAS_CELLS = 2.2  # a surface 60 degrees aslant does not shade itself
_UP = np.array([0.0, -1.0, 0.0])
#: Where ambient light comes from: ahead, and a ring 60 degrees about the camera's axis.
_RING = np.linspace(0, 2 * np.pi, 6, endpoint=False)
_SKY = np.array([(0.0, 0.0, -1.0), *((0.87 * np.cos(a), 0.87 * np.sin(a), -0.5) for a in _RING)])
_SKY_CELL_MM = 2.5


#: Where lamps that stand anywhere point to.
_AT_MM = (0.0, 0.0, 450.0)


def shade(
    vertices_mm: Array,
    normals: Array,
    faces: NDArray[np.int32],
    albedo: Array,
    lights: tuple[Light, ...],
    ambient: float,
) -> Array:
    """Displayed (sRGB) colours ``(n, 4)``, 0 to 1, of a mesh in the camera frame.

    Parameters
    ----------
    vertices_mm, normals : (n, 3)
    faces : (m, 3)
    albedo : (n, 4)
        Linear reflectance; alpha is kept.
    lights : tuple of Light
    ambient : float
        Light from everywhere, a little more from above.
    """
    to_eye = -vertices_mm / np.linalg.norm(vertices_mm, axis=1, keepdims=True)
    sky = ambient * (1.0 + 0.25 * (normals @ _UP)) * openness(vertices_mm, normals, faces)
    diffuse = np.repeat(sky[:, None], 3, axis=1)
    gloss = np.zeros_like(diffuse)
    for lamp in lights:
        to_lamp, strength = _arriving(lamp, vertices_mm)
        facing = np.sum(normals * to_lamp, axis=1)
        if lamp.kind != "point":
            strength = strength * visibility(vertices_mm, faces, lamp)
        colour = np.array(lamp.colour) * strength[:, None]
        diffuse += colour * np.clip((facing + _WRAP) / (1 + _WRAP), 0, None)[:, None]
        half = to_lamp + to_eye
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        shine = np.clip(np.sum(normals * half, axis=1), 0, None) ** _GLOSS_POWER
        gloss += colour * (_GLOSS * shine * (facing > 0))[:, None]
    light = albedo[:, :3] * diffuse + gloss
    return np.concatenate([np.clip(light, 0, 1) ** (1 / 2.2), albedo[:, 3:]], axis=1)


def lamps(look: Look, seed: int) -> tuple[tuple[Light, ...], float]:
    """The lamps of a scene and the light from everywhere; any, if it names none."""
    if look.lights:
        return look.lights, look.ambient
    return random_light(np.random.default_rng([seed, 3]))


def random_light(rng: np.random.Generator) -> tuple[tuple[Light, ...], float]:
    """A sun and up to two bulbs, mostly from above, and the light from everywhere."""
    lights = []
    for k in range(rng.integers(1, 4)):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        way[2] = -abs(way[2])
        if rng.random() < 0.7:
            way[1] = -abs(way[1])
        x, y, z = 500 * way + _AT_MM
        strength = float(rng.uniform(0.05, 0.4) if k else rng.uniform(0.2, 0.9))
        lights.append(Light("point" if k else "sun", (x, y, z), _AT_MM, strength))
    return tuple(lights), float(rng.uniform(0.15, 0.6))


def _arriving(lamp: Light, vertices_mm: Array) -> tuple[Array, Array]:
    """Direction to the lamp ``(n, 3)`` and strength ``(n,)``, before shadows."""
    at, source = np.array(lamp.at_mm), np.array(lamp.from_mm)
    axis = (source - at) / np.linalg.norm(source - at)
    if lamp.kind == "sun":
        return np.broadcast_to(axis, vertices_mm.shape), np.full(len(vertices_mm), lamp.intensity)
    offset = source - vertices_mm
    distance = np.linalg.norm(offset, axis=1)
    to_lamp = offset / distance[:, None]
    strength = lamp.intensity * (np.linalg.norm(source - at) / distance) ** 2
    if lamp.kind == "spot":
        off_axis = np.arccos(np.clip(to_lamp @ axis, -1, 1))
        strength = strength * np.clip((0.7 - off_axis) / 0.35, 0, 1)
    return to_lamp, strength


def visibility(vertices_mm: Array, faces: NDArray[np.int32], lamp: Light) -> Array:
    """Share of the lamp that each vertex sees ``(n,)``, 0 in full shadow."""
    at, source = np.array(lamp.at_mm), np.array(lamp.from_mm)
    axis = (at - source) / np.linalg.norm(at - source)
    seen = (vertices_mm - source) @ _view_along(axis)
    if lamp.kind == "spot":  # perspective from the lamp, scaled back to mm at the hand
        seen[:, :2] *= seen[:, 2].mean() / seen[:, 2:]
    return _lit(seen, faces, _CELL_MM)


def openness(vertices_mm: Array, normals: Array, faces: NDArray[np.int32]) -> Array:
    """Share of the light from everywhere that reaches each vertex ``(n,)``.

    Directions behind a vertex's own surface do not count against it.
    """
    got, due = np.full(len(vertices_mm), 1e-3), np.full(len(vertices_mm), 1e-3)
    for direction in _SKY:
        facing = np.clip(normals @ direction, 0.0, None)
        got += facing * _lit(vertices_mm @ _view_along(-direction), faces, _SKY_CELL_MM)
        due += facing
    return got / due


def _view_along(axis: Array) -> Array:
    """Columns ``(3, 3)``: two directions across ``axis``, and ``axis``."""
    side = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)


def _lit(seen: Array, faces: NDArray[np.int32], cell_mm: float) -> Array:
    """What is not hidden of points ``(n, 3)``, as seen along z from far away."""
    cells = (seen[:, :2] - seen[:, :2].min(axis=0)) / cell_mm + 1.0
    width, height = (np.ceil(cells.max(axis=0)) + 2).astype(int)
    nearest = np.full((height, width), np.inf)
    points = np.concatenate([cells, seen[:, 2:]], axis=1)
    _draw_depth(nearest, points, faces)
    return np.asarray(_compare(nearest, points, _BIAS_CELLS * cell_mm))


@numba.njit(cache=True)
def _draw_depth(nearest, points, faces):  # type: ignore[no-untyped-def]
    """Keep the smallest depth of the triangles in every cell they cover."""
    for f in range(faces.shape[0]):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-9:
            continue
        for v in range(int(np.ceil(min(a[1], b[1], c[1]))), int(max(a[1], b[1], c[1])) + 1):
            for u in range(int(np.ceil(min(a[0], b[0], c[0]))), int(max(a[0], b[0], c[0])) + 1):
                w1 = ((u - a[0]) * (c[1] - a[1]) - (v - a[1]) * (c[0] - a[0])) / area
                w2 = ((b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])) / area
                if w1 >= 0 and w2 >= 0 and w1 + w2 <= 1:
                    depth = a[2] + w1 * (b[2] - a[2]) + w2 * (c[2] - a[2])
                    nearest[v, u] = min(nearest[v, u], depth)


@numba.njit(cache=True)
def _compare(nearest, points, bias):  # type: ignore[no-untyped-def]
    """Share of 3 x 3 cells about each point in which nothing nearer was drawn."""
    share = np.zeros(points.shape[0])
    for i in range(points.shape[0]):
        u, v = int(points[i, 0] + 0.5), int(points[i, 1] + 0.5)
        for dv in range(-1, 2):
            for du in range(-1, 2):
                if points[i, 2] < nearest[v + dv, u + du] + bias:
                    share[i] += 1.0 / 9.0
    return share
