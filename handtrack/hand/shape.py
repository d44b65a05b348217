"""The shape of one hand: bone lengths, joint centres and axes, thickness, palm outline.

All of it is in the palm frame of a **right** hand (a left hand is tracked mirrored): origin at
the wrist, y to the middle MCP, z out of the palm, x to the thumb's side, mm. The rest frame of a
digit has y along the straight digit, and its first joint flexes about its x and abducts about
its -z; so the rest frames carry the fan of the fingers, their convergence when they close
(a roll about y) and the thumb's opposition.

>>> hand = HandShape.default()
>>> hand.length_mm.shape, hand.base_mm[2].tolist()
((5, 3), [0.0, 88.0, 0.0])
"""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.skeleton import DIGITS
from handtrack.toml_file import check_keys, read_document, write_document

Array = NDArray[np.float64]
FORMAT = "handtrack-hand"
FORMAT_VERSION = 1

_ARRAY_SHAPES: dict[str, tuple[int | None, ...]] = {
    "base_mm": (5, 3),
    "rest_rotvec": (5, 3),
    "length_mm": (5, 3),
    "radius_mm": (5, 4),
    "palm_outline_mm": (None, 2),
}


@dataclass(frozen=True, eq=False)
class HandShape:
    """Sizes of a hand, read-only arrays.

    Parameters
    ----------
    base_mm : (5, 3)
        Centre of each digit's first joint (thumb CMC, finger MCPs).
    rest_rotvec : (5, 3)
        Rest orientation of each digit in the palm frame, rotation vector in radians.
    length_mm : (5, 3)
        Bones of each digit from its first joint to its tip.
    radius_mm : (5, 4)
        Half thickness at the three joints and at the tip; the last bone ends on the tip's skin.
    palm_outline_mm : (n, 2)
        Outline of the flat palm from the wrist's thumb side round the knuckles and back, in x, y.
    palm_radius_mm : float
        Half thickness of the palm.
    wrist_radius_mm : float
        Half width of the wrist and the forearm stub.
    calibrated : bool
        False for the default adult hand, whose absolute scale means nothing.
    source : str
        Where the numbers come from.

    Raises
    ------
    InputError
        An array has another shape, or a length is not positive and finite.
    """

    base_mm: Array
    rest_rotvec: Array
    length_mm: Array
    radius_mm: Array
    palm_outline_mm: Array
    palm_radius_mm: float
    wrist_radius_mm: float
    calibrated: bool = False
    source: str = "default adult hand"

    def __post_init__(self) -> None:
        for name, shape in _ARRAY_SHAPES.items():
            array = np.array(getattr(self, name), dtype=float)
            fits = array.ndim == len(shape) and all(
                want in (None, have) for want, have in zip(shape, array.shape, strict=True)
            )
            if not fits or not np.isfinite(array).all():
                raise InputError(
                    f"hand shape: {name} has shape {array.shape}, wanted {shape} of finite numbers"
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        for name in ("palm_radius_mm", "wrist_radius_mm"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
                raise InputError(f"hand shape: {name} = {value!r} is no number")
        for name in ("length_mm", "radius_mm", "palm_radius_mm", "wrist_radius_mm"):
            values = np.asarray(getattr(self, name))
            if not (np.isfinite(values) & (values > 0)).all():
                raise InputError(f"hand shape: {name} must be positive everywhere")

    @classmethod
    def default(cls) -> "HandShape":
        """An adult hand about 185 mm long.

        Bone shares after the anthropometric tables of Buryanov and Kotiuk, "Proportions of Hand
        Segments" (Int. J. Morphol. 2010), rounded; joint centres by eye. The rolls are about those
        in which the bones of recorded digits stay best in one plane (thumb: 72, 85 and 90 deg in
        three data sets), so that the thumb flexes across the palm and abducts out of it.
        """
        fan = np.radians([-42.0, -5.0, 0.0, 5.0, 13.0])  # about z, towards the little finger
        roll = np.radians([-80.0, -4.0, 0.0, 5.0, 10.0])  # about y: which way closing leads
        return cls(
            base_mm=np.array(
                [[20, 20, 6], [23.5, 86, 0], [0, 88, 0], [-19.5, 81, 0], [-36.5, 70, 0]], float
            ),
            rest_rotvec=_rest_rotvec(fan, roll),
            length_mm=np.array(
                [[45, 34, 29], [43, 25, 24], [47, 29, 25], [43, 28, 25], [34, 20, 22]], float
            ),
            radius_mm=np.array(
                [
                    [14, 11, 9.5, 7.5],
                    [11, 9, 8, 6.5],
                    [11, 9, 8, 6.5],
                    [10.5, 8.5, 7.5, 6.2],
                    [9.5, 7.5, 6.5, 5.5],
                ]
            ),
            palm_outline_mm=np.array(
                [
                    [24, -4],
                    [34, 22],
                    [35, 50],
                    [34, 84],
                    [28, 98],
                    [0, 101],
                    [-22, 94],
                    [-42, 80],
                    [-46, 66],
                    [-42, 36],
                    [-30, 6],
                    [-25, -4],
                ],
                float,
            ),
            palm_radius_mm=12.0,
            wrist_radius_mm=26.0,
        )

    @property
    def palm_length_mm(self) -> float:
        """Wrist to middle MCP: the unit in which errors of keypoints are compared."""
        return float(np.linalg.norm(self.base_mm[2]))

    def scaled(self, factor: float) -> "HandShape":
        """The same hand, ``factor`` times as large."""
        return replace(
            self,
            **{f.name: getattr(self, f.name) * factor for f in fields(self) if "_mm" in f.name},
        )

    def save(self, path: str | Path) -> None:
        """Write ``hand.toml``: mm and radians, one table a digit."""
        document = {
            "source": self.source,
            "calibrated": self.calibrated,
            "palm_radius_mm": self.palm_radius_mm,
            "wrist_radius_mm": self.wrist_radius_mm,
            "palm_outline_mm": np.round(self.palm_outline_mm, 4).tolist(),
        } | {
            digit: {name: np.round(getattr(self, name)[d], 6).tolist() for name in _DIGIT_FIELDS}
            for d, digit in enumerate(DIGITS)
        }
        write_document(path, FORMAT, FORMAT_VERSION, document)

    @classmethod
    def load(cls, path: str | Path) -> "HandShape":
        """Read what :meth:`save` wrote.

        Raises
        ------
        InputError
            The file is missing, is not TOML, is of another version, lacks a key or has one
            that is not known.
        """
        document = read_document(path, FORMAT, FORMAT_VERSION)
        digits = {digit: document.pop(digit, {}) for digit in DIGITS}
        for digit, table in digits.items():
            if not isinstance(table, dict):
                raise InputError(f"{path}: {digit} = {table!r}, wanted a table [{digit}]")
        found = {f"{d}.{k}" for d in DIGITS for k in digits[d]} | set(document)
        wanted = {f"{d}.{k}" for d in DIGITS for k in _DIGIT_FIELDS}
        wanted |= {f.name for f in fields(cls)} - set(_DIGIT_FIELDS)
        check_keys(path, found, wanted, set())
        try:
            document |= {k: np.array([digits[d][k] for d in DIGITS], float) for k in _DIGIT_FIELDS}
            return cls(**document)
        except (InputError, TypeError, ValueError) as error:
            raise InputError(f"{path}: {error}") from error


_DIGIT_FIELDS = ("base_mm", "rest_rotvec", "length_mm", "radius_mm")


def _rest_rotvec(fan: Array, roll: Array) -> Array:
    """Rest frames ``(5, 3)``: turn by ``fan`` about z, then ``roll`` about the digit itself."""
    return rotation.log(rotation.about_z(fan) @ rotation.about_y(roll))
