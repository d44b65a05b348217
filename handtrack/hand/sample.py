"""The sample a configuration space is fitted to: recordings, and draws inside anatomical limits.

What may be shipped is fitted from two recorded sets, and both are one-sided: open hands and
fists are most of their frames, one computes the DIP from the PIP, and the other stops the DIP
at 45 deg. So half of the sample is recorded and half is drawn:

- *recorded*: frames at least ``THIN_DEG`` apart, so that a hand held still counts once; the sets
  weigh the same.
- *walks*: points on the lines between two basis states, each digit with a timing of its own, for
  fingers do not close in step. They carry the paper's assumption that hands move along lines.
- *curls*: each digit bends by itself. Bends of neighbours correlate (``NEIGHBOURS``), and so do
  the joints of one digit (``JOINTS``), but neither fully: real fingers bend DIP and PIP, and MCP
  and PIP, separately. Normal variables with these correlations are made uniform over the range
  from extended to curled, a little beyond at both ends.

Abductions are drawn for both kinds: a splay that all fingers share and one of each finger's
own, both fading as the MCP bends, since ligaments tighten. Everything gets measurement noise and
is clipped to the limits.

>>> rng = np.random.default_rng(0)
>>> theta = draw_curls(1000, np.zeros(20), np.ones(20), rng)
>>> theta.shape, bool(np.corrcoef(theta[:, 6], theta[:, 7])[0, 1] > 0.3)
((1000, 20), True)
"""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from handtrack.hand.basis import Basis
from handtrack.hand.skeleton import LIMITS, N_ANGLES

Array = NDArray[np.float64]

THIN_DEG = 2.0
NOISE_DEG = 2.0
#: Correlation of the bends of neighbouring digits, thumb-index first, and of joints of a digit.
NEIGHBOURS = (0.3, 0.5, 0.7, 0.7)
JOINTS = 0.6
#: Shared splay and each finger's own abduction, standard deviations, with straight fingers.
SPLAY_DEG, ABDUCTION_DEG, THUMB_ABDUCTION_DEG = 5.0, 4.0, 12.0
#: How the shared splay opens index, middle, ring and little finger.
_FAN = np.array([1.0, 0.2, -0.7, -1.6])
_BEYOND = 0.08  # of the range from extended to curled, at both ends
_TIMING = 0.15  # standard deviation of a digit's own place on a walk


def draw_sample(
    sets: list[Array], basis: Basis, n: int, rng: np.random.Generator
) -> tuple[Array, dict[str, int]]:
    """``n`` angles ``(n, 20)`` from recorded sets and draws, and how many of each kind."""
    counts = {"recorded": n // 2, "walks": n // 4}
    counts["curls"] = n - sum(counts.values())
    each = np.array_split(np.arange(counts["recorded"]), len(sets))
    recorded = [
        thinned[rng.integers(len(thinned), size=len(part))]
        for thinned, part in zip(map(thin, sets), each, strict=True)
    ]
    theta = np.concatenate(
        [
            *recorded,
            draw_walks(counts["walks"], basis, rng),
            draw_curls(counts["curls"], basis.extended, basis.curled, rng),
        ]
    )
    noisy = theta + rng.normal(scale=np.radians(NOISE_DEG), size=theta.shape)
    return np.clip(noisy, LIMITS[:, 0], LIMITS[:, 1]), counts


def thin(theta: Array, apart_deg: float = THIN_DEG) -> Array:
    """The frames of ``(n, 20)`` in which some angle has moved by ``apart_deg`` since the last."""
    kept = [0] if len(theta) else []
    for f in range(1, len(theta)):
        if np.abs(theta[f] - theta[kept[-1]]).max() >= np.radians(apart_deg):
            kept.append(f)
    return theta[kept]


def draw_walks(n: int, basis: Basis, rng: np.random.Generator) -> Array:
    """Angles ``(n, 20)`` on the way from one basis state to another."""
    i = rng.integers(len(basis.states), size=n)
    j = (i + rng.integers(1, len(basis.states), size=n)) % len(basis.states)
    s = rng.uniform(size=(n, 1)) + rng.normal(scale=_TIMING, size=(n, 5))
    s = np.repeat(np.clip(s, 0, 1), 4, axis=1)
    theta = (1 - s) * basis.theta[i] + s * basis.theta[j]
    return _abducted(theta, rng)


def draw_curls(n: int, extended: Array, curled: Array, rng: np.random.Generator) -> Array:
    """Angles ``(n, 20)`` of digits that bend by themselves."""
    digits = np.eye(5)
    for a in range(5):
        for b in range(a + 1, 5):
            digits[a, b] = digits[b, a] = np.prod(NEIGHBOURS[a:b])
    joints = np.full((3, 3), JOINTS) + (1 - JOINTS) * np.eye(3)
    z = rng.normal(size=(n, 15)) @ np.linalg.cholesky(np.kron(digits, joints)).T
    u = (norm.cdf(z) * (1 + 2 * _BEYOND) - _BEYOND).reshape(n, 5, 3)
    bent = (curled - extended).reshape(5, 4)
    theta = np.tile(extended, (n, 1)).reshape(n, 5, 4)
    theta[..., [0, 2, 3]] += u * bent[:, [0, 2, 3]]
    theta[..., 1] += u[..., 0] * bent[:, 1]
    return _abducted(theta.reshape(n, N_ANGLES), rng)


def _abducted(theta: Array, rng: np.random.Generator) -> Array:
    """The same angles with drawn abductions on top."""
    n = len(theta)
    room = np.clip(np.cos(theta[:, 4::4]), 0.1, 1.0)
    own = rng.normal(scale=ABDUCTION_DEG, size=(n, 4))
    splay = rng.normal(scale=SPLAY_DEG, size=(n, 1)) * _FAN
    out = theta.copy()
    out[:, 5::4] += np.radians(own + splay) * room
    out[:, 1] += np.radians(rng.normal(scale=THUMB_ABDUCTION_DEG, size=n))
    return out
