"""What calibration may change about a hand, as one vector of numbers that should be about 1.

Every unknown is ``x = sigma z``: ``sigma`` is how far hands differ from the default one there, so
the prior is simply ``|z|^2`` and a ``z`` of 3 is a surprise. Unknowns and their ``sigma``:

- pose: turn about the line of sight and shift (free), tilt 1 deg (one frontal picture cannot tell
  it), log of the depth (free: it carries the scale, because the palm keeps its length);
- lengths: a factor common to all digits 6 %, one per digit 6 % (8 % together; 12 % for the
  thumb), shares of the bones 3 %;
- joint centres 3 mm (the middle one defines the frame), the thumb's 4 mm;
- where the webs end, 5 % of the proximal bones, the same for all;
- radii: a common factor 15 %, each joint 8 %;
- flexion axes: fan 3 deg, roll 4 deg; the thumb's rest direction 8 deg each way;
- angles of this picture: abduction 8 deg; the thumb's four 12 deg.

>>> import numpy as np
>>> from handtrack.hand.shape import HandShape
>>> hands = unpack(np.zeros((1, N)), HandShape.default())
>>> bool(np.allclose(hands.length_mm[0], HandShape.default().length_mm))
True
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.hand.shape import HandShape

Array = NDArray[np.float64]

_DEG = np.pi / 180
#: The four angles of a finger and of the thumb in a relaxed open hand.
OPEN_FINGER = np.array([4.0, 0.0, 4.0, 3.0]) * _DEG
OPEN_THUMB = np.array([0.0, 5.0, 10.0, 5.0]) * _DEG
#: Name, shape and sigma of each block of unknowns, in order.
_BLOCKS: tuple[tuple[str, tuple[int, ...], tuple[float, ...] | float], ...] = (
    ("turn", (3,), (1 * _DEG, 1 * _DEG, 60 * _DEG)),  # camera axes x, y, z
    ("shift_mm", (2,), 100.0),
    ("log_depth", (), 0.5),
    ("log_length_all", (), 0.06),
    ("log_length", (5,), (0.10, 0.06, 0.06, 0.06, 0.06)),
    ("share", (5, 2), 0.03),
    ("base_mm", (5, 2), (4.0, 4.0, 3.0, 3.0, 0.01, 0.01, 3.0, 3.0, 3.0, 3.0)),
    ("web_share", (), 0.05),
    ("log_radius_all", (), 0.15),
    ("log_radius", (5, 4), 0.08),
    ("fan", (5,), (8 * _DEG, 3 * _DEG, 1 * _DEG, 3 * _DEG, 3 * _DEG)),
    ("roll", (5,), (8 * _DEG, 4 * _DEG, 2 * _DEG, 4 * _DEG, 4 * _DEG)),
    ("lift", (), 8 * _DEG),  # the thumb's rest direction, out of the palm
    ("abduction", (4,), 8 * _DEG),
    ("thumb", (4,), 12 * _DEG),
)


def _layout() -> tuple[dict[str, tuple[slice, tuple[int, ...]]], Array]:
    where, sigma, start = {}, [], 0
    for name, shape, scale in _BLOCKS:
        size = int(np.prod(shape))
        where[name] = (slice(start, start + size), shape)
        sigma.append(np.broadcast_to(np.asarray(scale, float), size))
        start += size
    return where, np.concatenate(sigma)


_WHERE, SIGMA = _layout()
SIGMA.setflags(write=False)
N = len(SIGMA)
#: Which unknowns ``(N,)`` are of the pose and of the angles, not of the hand's shape.
POSE = np.zeros(N, bool)
for _name in ("turn", "shift_mm", "log_depth", "web_share", "abduction", "thumb"):
    POSE[_WHERE[_name][0]] = True
POSE.setflags(write=False)


def thumb_grid() -> Array:
    """Unknowns ``(35, N)`` that differ in the thumb's direction and bend only."""
    turn, bend = np.meshgrid(np.arange(-30, 61, 15) * _DEG, np.arange(-15, 46, 15) * _DEG)
    z = np.zeros((turn.size, N))
    thumb = _WHERE["thumb"][0]
    z[:, thumb.start + 1] = turn.ravel() / SIGMA[thumb.start + 1]
    z[:, thumb.start + 2] = bend.ravel() / SIGMA[thumb.start + 2]
    return z


@dataclass(frozen=True, eq=False)
class Hands:
    """A batch of hands and their poses relative to the start; ``n`` leads every array."""

    turn: Array  # (n, 3) rotation vector in camera axes
    shift_mm: Array  # (n, 2)
    depth_factor: Array  # (n,)
    base_mm: Array  # (n, 5, 3)
    rest: Array  # (n, 5, 3, 3)
    length_mm: Array  # (n, 5, 3)
    web_share: Array  # (n,) added to the usual share of the proximal bones
    radius_mm: Array  # (n, 5, 4)
    theta: Array  # (n, 20)


def unpack(z: Array, default: HandShape) -> Hands:
    """The hands and poses of unknowns ``z`` ``(n, N)`` around ``default``."""
    x = z * SIGMA
    part = {name: x[:, at].reshape(len(x), *shape) for name, (at, shape) in _WHERE.items()}
    theta = np.zeros((len(x), 20))
    theta[:, 4:] = np.tile(OPEN_FINGER, 4)
    theta[:, 5::4] = part["abduction"]
    theta[:, :4] = OPEN_THUMB + part["thumb"]
    base = np.broadcast_to(default.base_mm, (len(x), 5, 3)).copy()
    base[..., :2] += part["base_mm"]
    base[:, 2] = default.base_mm[2]
    return Hands(
        turn=part["turn"],
        shift_mm=part["shift_mm"],
        depth_factor=np.exp(part["log_depth"]),
        base_mm=base,
        rest=_rest(part, default),
        length_mm=_lengths(part, default),
        web_share=part["web_share"],
        radius_mm=default.radius_mm
        * np.exp(part["log_radius_all"][:, None, None] + part["log_radius"]),
        theta=theta,
    )


def _rest(part: dict[str, Array], default: HandShape) -> Array:
    """Rest frames ``(n, 5, 3, 3)``: turned about z by the fan, about the digit by the roll."""
    lift = np.zeros_like(part["fan"])
    lift[:, 0] = part["lift"]
    rest = rotation.exp(default.rest_rotvec)
    turned = rotation.about_z(part["fan"]) @ rotation.about_x(lift) @ rest
    return np.asarray(turned @ rotation.about_y(part["roll"]))


def _lengths(part: dict[str, Array], default: HandShape) -> Array:
    """Bone lengths ``(n, 5, 3)``; a digit's shares change without changing its total."""
    total = np.exp(part["log_length_all"][:, None] + part["log_length"])
    share = part["share"]
    weight = np.exp(np.concatenate([share, -share.sum(axis=-1, keepdims=True)], axis=-1))
    length = default.length_mm * weight
    length *= default.length_mm.sum(axis=1, keepdims=True) / length.sum(axis=-1, keepdims=True)
    return np.asarray(length * total[..., None])
