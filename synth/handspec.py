"""A hand as ``synth`` knows it: joints, rest frames, bones, thickness, the fleshy parts.

Palm frame of a right hand, mm: origin at the wrist, y to the middle MCP, z out of the palm, x to
the thumb's side. A digit's rest frame is ``Rz(fan) Rx(pitch) Ry(roll)``. Shapes are data, in
``synth/hands/*.toml``; `HAND_NAMES` lists them.

>>> HandSpec.named("average").length_mm.shape
(5, 3)
"""

import tomllib
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from synth import quaternion as quat

Array = NDArray[np.float64]

HANDS_DIR = Path(__file__).parent / "hands"
HAND_NAMES = tuple(sorted(path.stem for path in HANDS_DIR.glob("*.toml")))


@dataclass(frozen=True, eq=False)
class HandSpec:
    """Sizes of a synthetic hand, all in the palm frame; arrays are read-only.

    Parameters
    ----------
    base_mm : (5, 3)
        Centre of each digit's first joint (thumb CMC, finger MCPs).
    fan_deg, pitch_deg, roll_deg : (5,)
        Rest frame of each digit: turn in the palm's plane, out of it, and about the digit.
    length_mm : (5, 3)
        Bones of each digit; the last ends on the skin of the tip.
    radius_mm : (5, 4)
        Half thickness at the three joints and at the tip.
    palm_thickness_mm : (2,)
        Half thickness of the palm at the wrist and at the knuckles.
    thenar_mm, hypothenar_mm : float
        Radius of the two balls of the palm.
    web : float
        Where the webs end, as a share of the fingers' first bones.
    wrist_mm : (2,)
        Half width and half thickness of the wrist.
    forearm_mm : (2,)
        The same, 200 mm up the forearm.
    """

    base_mm: Array
    fan_deg: Array
    pitch_deg: Array
    roll_deg: Array
    length_mm: Array
    radius_mm: Array
    palm_thickness_mm: Array
    thenar_mm: float
    hypothenar_mm: float
    web: float
    wrist_mm: Array
    forearm_mm: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.type is Array:
                array = np.array(getattr(self, field.name), dtype=float)
                array.setflags(write=False)
                object.__setattr__(self, field.name, array)

    @property
    def rest(self) -> Array:
        """Rest frames of the digits in the palm frame, quaternions ``(5, 4)``."""
        fan, pitch, roll = np.radians([self.fan_deg, self.pitch_deg, self.roll_deg])
        return quat.multiply(
            quat.multiply(quat.turn("z", fan), quat.turn("x", pitch)), quat.turn("y", roll)
        )

    @classmethod
    def named(cls, name: str) -> "HandSpec":
        """One of `HAND_NAMES`.

        Raises
        ------
        InputError
            There is no hand of that name.
        """
        if name not in HAND_NAMES:
            raise InputError(f"no hand named '{name}'; there are {', '.join(HAND_NAMES)}")
        return _load(name)


@cache
def _load(name: str) -> HandSpec:
    return HandSpec(**tomllib.loads((HANDS_DIR / f"{name}.toml").read_text(encoding="utf-8")))
