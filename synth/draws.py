"""Any hand, any pose: what pictures to learn from are drawn from.

Hands are blends of the shipped ones with their own lengths and girths; fingers are on the lines
between states, as in the shipped recording, or bent joint by joint; the palm or the back is shown,
tilted.
"""

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handtrack.hand.skeleton import LIMITS
from synth.fingers import recorded, some_state
from synth.handspec import HAND_NAMES, HandSpec

Array = NDArray[np.float64]

#: How much of the spread of the fingers each finger takes.
_SPREAD = np.array([0.0, 1.0, 0.3, -0.4, -1.0])
#: Standard deviations of a palm's tilt about x and y, degrees, and in what share of the pictures.
_TILT_DEG, _TILT_SHARE = (25.0, 50.0, 90.0), (0.6, 0.3, 0.1)


def random_hand(rng: np.random.Generator) -> HandSpec:
    """A blend of two of the shipped hands, with lengths, girths and a thumb of its own."""
    one, other = (HandSpec.named(str(name)) for name in rng.choice(HAND_NAMES, 2))
    w = rng.random()
    v: dict[str, Any] = {
        f.name: (1 - w) * np.asarray(getattr(one, f.name)) + w * np.asarray(getattr(other, f.name))
        for f in fields(HandSpec)
    }
    v["length_mm"] *= np.exp(rng.normal(0, 0.05, (5, 1)) + rng.normal(0, 0.03, (5, 3)))
    girth = rng.normal(0, 0.1) + rng.normal(0, 0.05, (5, 1)) + rng.normal(0, 0.04, (5, 4))
    v["radius_mm"] *= np.exp(girth)
    v["fan_deg"] += rng.normal(0, [5.4, 2, 2, 2, 2])
    v["roll_deg"] += rng.normal(0, [8, 0, 0, 0, 0])
    for name, spread in (
        ("thenar_mm", 0.07), ("hypothenar_mm", 0.07), ("web", 0.07),
        ("palm_thickness_mm", 0.08), ("wrist_mm", 0.07), ("forearm_mm", 0.1),
    ):  # fmt: skip
        v[name] = v[name] * np.exp(rng.normal(0, spread))
    for name in ("thenar_mm", "hypothenar_mm", "web"):
        v[name] = float(v[name])
    return HandSpec(**v)


def random_angles(rng: np.random.Generator) -> Array:
    """Angles ``(20,)``, radians: between states, as recorded, or bent joint by joint."""
    kind = rng.random()
    if kind < 0.35:
        s = rng.random() if rng.random() < 0.7 else 0.0
        theta = (1 - s) * some_state(rng) + s * some_state(rng)
    elif kind < 0.5:
        motion = recorded("")
        theta = motion[rng.integers(len(motion))] + np.radians(rng.normal(0, 5, 20))
    else:
        theta = np.radians(_joint_by_joint(rng)).ravel()
    return np.clip(theta, *LIMITS.T)


def _joint_by_joint(rng: np.random.Generator) -> Array:
    """Angles ``(5, 4)`` in degrees; in half of the hands the fingers have much in common."""
    deg = np.zeros((5, 4))
    deg[0] = rng.uniform((-12, -8, -8, -12), (42, 36, 52, 62))
    common, alike = rng.random(3), rng.random() < 0.5
    for finger in range(1, 5):
        own = rng.random(3)
        x = np.where(rng.random(3) < 0.5, common, own) if alike else own
        mcp, pip = -12 + 102 * x[0], 110 * x[1]
        dip = pip * (0.25 + 0.75 * x[2]) + rng.normal(0, 6)
        if rng.random() < 0.15:
            dip = rng.uniform(0, 20)
        deg[finger] = mcp, rng.normal(0, 7) * (1 - 0.7 * max(mcp, 0.0) / 90), pip, dip
    deg[:, 1] += _SPREAD * rng.normal(3, 5)
    return deg


def random_rotation(rng: np.random.Generator) -> Array:
    """Palm to camera ``(3, 3)``: the palm or the back, fingers up, tilted and rolled."""
    side = np.diag([1.0, -1.0, -1.0] if rng.random() < 0.6 else [-1.0, -1.0, 1.0])
    tilt = float(rng.choice(_TILT_DEG, p=_TILT_SHARE))
    turn = np.radians([*rng.normal(0, tilt, 2), rng.normal(0, 25)])
    return np.asarray(Rotation.from_rotvec(turn).as_matrix() @ side)
