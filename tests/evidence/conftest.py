"""Drawn hands with an exact silhouette: shaded capsules over backgrounds of all kinds."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape

SKIN = {
    "pale": (236, 196, 176),
    "light": (214, 160, 136),
    "brown": (150, 100, 70),
    "dark": (82, 54, 42),
    "grey": (150, 150, 150),
    "blue": (70, 110, 190),
    "green": (90, 160, 90),
}


#: Distances are drawn out to here.
FAR_PX = 20.0


@dataclass(frozen=True)
class Drawn:
    """A picture ``(H, W, 3)``, its hand's exact signed distance ``(H, W)`` in px, its mask."""

    image: np.ndarray
    sdf: np.ndarray

    @property
    def mask(self):
        return self.sdf < 0


def hand_points(theta, turn, scale, centre):
    """Joints ``(21, 3)`` in px, z towards the viewer: a palm-first hand, fingers up, turned."""
    P = keypoints_mm(theta, HandShape.default())
    P = (P - [0, 75, 0]) @ rotation.exp(turn).T
    return P * [scale, -scale, scale] + [*centre, 0.0]


def capsules(theta, scale, turn, centre, forearm=True):
    """Tapered capsules ``(n, 8)``: ends (x, y, z) and radii, of fingers, palm and forearm."""
    shape = HandShape.default()
    X = hand_points(theta, turn, scale, centre)
    rows = []
    for d in range(5):
        chain = X[1 + 4 * d : 5 + 4 * d]
        for j in range(3):
            r0, r1 = shape.radius_mm[d, j] * scale, shape.radius_mm[d, j + 1] * scale
            rows.append((*chain[j], *chain[j + 1], r0, r1))
    for d in range(1, 5):  # metacarpals, thick and overlapping, make the palm
        rows.append((*(X[0] + 0.15 * (X[1 + 4 * d] - X[0])), *X[1 + 4 * d], 20 * scale, 14 * scale))
    if forearm:
        down = X[0] + 4.0 * (X[0] - X[9])
        rows.append((*X[0], *down, 24 * scale, 30 * scale))
    return np.array(rows)


def draw(
    background,
    colour,
    theta=None,
    scale=1.8,
    turn=(0, 0, 0),
    centre=None,
    forearm=True,
    supersample=2,
    noise=2.0,
    jpeg=80,
    blur=0.6,
    seed=0,
):
    """A hand drawn over ``background`` ``(H, W, 3)`` float; returns :class:`Drawn`."""
    rng = np.random.default_rng(seed)
    H, W = background.shape[:2]
    s = supersample
    theta = np.zeros(20) if theta is None else theta
    centre = (W / 2, H * 0.5) if centre is None else centre
    y, x = np.mgrid[: H * s, : W * s].astype(np.float32)
    x, y = (x + 0.5) / s - 0.5, (y + 0.5) / s - 0.5
    sdf = np.full(x.shape, FAR_PX, np.float32)
    height = np.full(x.shape, -1e3, np.float32)
    shade = np.ones(x.shape, np.float32)
    for x0, y0, z0, x1, y1, z1, r0, r1 in capsules(theta, scale, turn, centre, forearm):
        reach = max(r0, r1) + FAR_PX
        low = np.maximum(s * (np.minimum((x0, y0), (x1, y1)) - reach), 0).astype(int)
        high = np.maximum(s * (np.maximum((x0, y0), (x1, y1)) + reach), 0).astype(int)
        box = (slice(low[1], high[1]), slice(low[0], high[0]))
        dx, dy = x1 - x0, y1 - y0
        t = ((x[box] - x0) * dx + (y[box] - y0) * dy) / max(dx * dx + dy * dy, 1e-6)
        t = np.clip(t, 0, 1)
        r = r0 + t * (r1 - r0)
        across = x[box] - x0 - t * dx
        d = np.hypot(across, y[box] - y0 - t * dy)
        sdf[box] = np.minimum(sdf[box], d - r)
        top = np.sqrt(np.maximum(r * r - d * d, 0))
        z = z0 + t * (z1 - z0) + top
        front = (d < r) & (z > height[box])
        height[box][front] = z[front]
        shade[box][front] = (0.55 + 0.45 * top / r - 0.08 * across / r)[front]
    hand = shade[..., None] * np.array(colour, np.float32)
    hand += cv2.GaussianBlur(rng.normal(0, 12, (*x.shape, 1)).astype(np.float32), (0, 0), 6)[
        ..., None
    ]
    big = cv2.resize(background.astype(np.float32), (W * s, H * s))
    picture = np.where((sdf < 0)[..., None], hand, big)
    picture = cv2.resize(picture, (W, H), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(picture, (0, 0), blur) + rng.normal(0, noise, (H, W, 3))
    picture = np.clip(picture, 0, 255).astype(np.uint8)
    if jpeg:
        code = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1]
        picture = cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1]
    return Drawn(
        np.ascontiguousarray(picture), cv2.resize(sdf, (W, H), interpolation=cv2.INTER_AREA)
    )


def plain(shape=(480, 640), colour=(120, 122, 125)):
    return np.tile(np.array(colour, np.float32), (*shape, 1))


def gradient(shape=(480, 640), dark=60, bright=220):
    y, x = np.mgrid[-1 : 1 : shape[0] * 1j, -1 : 1 : shape[1] * 1j]
    level = dark + (bright - dark) * np.clip(0.5 + 0.35 * x - 0.3 * y, 0, 1)
    return (level[..., None] * np.array([1.0, 0.98, 0.93])).astype(np.float32)


def wood(shape=(480, 640), colour=(188, 140, 100), seed=0):
    """Planks of the chromaticity of skin."""
    rng = np.random.default_rng(seed)
    y = np.arange(shape[0])[:, None]
    grain = cv2.GaussianBlur(
        rng.normal(0, 90, shape).astype(np.float32), (0, 0), sigmaX=40, sigmaY=1.5
    )
    plank = (y // 90) * 7919 % 5 * 0.04
    level = 0.85 + plank + grain / 25
    return (level[..., None] * np.array(colour)).astype(np.float32)


def clutter(shape=(480, 640), seed=0, n=60):
    """Coloured boxes and discs of all sizes, a few of them of skin-like brown."""
    rng = np.random.default_rng(seed)
    picture = np.tile(rng.uniform(60, 200, 3).astype(np.float32), (*shape, 1))
    for k in range(n):
        x, y = rng.integers(0, shape[1]), rng.integers(0, shape[0])
        w, h = rng.integers(15, 150, 2)
        colour = (
            rng.uniform(10, 245, 3) if k % 6 else rng.uniform(0.6, 1.1) * np.array([180, 130, 100])
        )
        if k % 2:
            cv2.rectangle(picture, (int(x), int(y)), (int(x + w), int(y + h)), colour.tolist(), -1)
        else:
            cv2.ellipse(
                picture,
                (int(x), int(y)),
                (int(w // 2), int(h // 2)),
                float(rng.uniform(0, 180)),
                0,
                360,
                colour.tolist(),
                -1,
            )
    return cv2.GaussianBlur(picture, (0, 0), 1.0)


def curled(fingers, amount=1.4):
    theta = np.zeros(20)
    for d in fingers:
        theta[4 * d] = 0.9 * amount if d else 0.6
        theta[4 * d + 2] = amount if d else 0.5
        theta[4 * d + 3] = 0.7 * amount
    return theta


def spread():
    theta = np.zeros(20)
    theta[[1, 5, 13, 17]] = 0.3, 0.15, -0.12, -0.3
    return theta


@pytest.fixture(scope="session")
def drawing():
    """The functions of this file, as one object."""
    import types

    names = ("draw", "plain", "gradient", "wood", "clutter", "curled", "spread", "SKIN", "Drawn")
    return types.SimpleNamespace(**{name: globals()[name] for name in names})
