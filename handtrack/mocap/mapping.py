"""From the joints of any skeleton to our 20 angles: a mapping file says which joint is which.

Two kinds of mapping, both TOML. ``[angles]`` reads channels: the skeleton has our hinges, and each
of our angles is one of its channels, times ``sign``, plus ``offset_deg``. ``[keypoints]`` reads
positions: its joints stand where our keypoints do, and the angles follow from the directions of
its bones (:mod:`handtrack.hand.inverse`); this needs no knowledge of the skeleton's axes, and
angles that wrap in its channels do not wrap here.

Positions need a palm frame: y from the wrist to the middle knuckle, x towards the index side of
the row of knuckles, z to the side to which the fingers curl. So a left hand, or a skeleton stored
in left-handed axes, comes out as the right hand that mirrors it.

>>> mapping = read_mapping("manipnet")
>>> mapping.unit_mm, mapping.keypoints["index_pip"]
(100.0, 'INDEX_PIP_FE')
"""

import tomllib
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.inverse import angles_of_bones
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import ANGLE_NAMES, DIGITS, KEYPOINT_NAMES
from handtrack.mocap.bvh import Motion

Array = NDArray[np.float64]

#: Mappings in the package, by name.
SHIPPED = ("manipnet", "handtrack")
#: Pulls the abduction of a digit that points straight out of the palm, and shows none, to zero.
DAMPING = 0.5

_TIPS = tuple(name for name in KEYPOINT_NAMES if name.endswith("_tip"))
_JOINTS = tuple(name for name in KEYPOINT_NAMES if name not in _TIPS)
_ANGLE_KEYS = {"joint", "channel", "sign", "offset_deg", "flips_on_left"}


@dataclass(frozen=True)
class Mapping:
    """Which joint of a skeleton is which of ours; either ``keypoints`` or ``angles`` is filled.

    Parameters
    ----------
    skeleton : what the mapping is for, a sentence.
    unit_mm : the file's unit of length in mm.
    keypoints : keypoint name to joint name, all but the tips.
    tip_mm : length of each digit's last bone, thumb to little, where the End Site is at zero; the
        bone then continues the one before it when its hinge is at zero.
    yaw_deg : turn about z that puts the fingers, on average, in line with their metacarpals.
    left_handed_axes : the file's axes are left-handed: read so, a right hand looks like a left one.
    angles : angle name to ``joint``, ``channel``, ``sign``, ``offset_deg``, ``flips_on_left``.
    """

    skeleton: str
    unit_mm: float = 1.0
    keypoints: dict[str, str] = field(default_factory=dict)
    tip_mm: tuple[float, ...] = ()
    yaw_deg: float = 0.0
    left_handed_axes: bool = False
    angles: dict[str, dict[str, Any]] = field(default_factory=dict)

    def theta(self, motion: Motion) -> tuple[Array, Array]:
        """Angles ``(F, 20)`` in radians, and how far bones leave their plane ``(F, 5)``.

        Raises
        ------
        InputError
            A joint or a channel that the mapping names is not in the skeleton.
        """
        self.check(motion)
        if self.angles:
            return self._by_channels(motion), np.zeros((motion.n_frames, 5))
        points = in_palm_frame(self.positions_mm(motion))
        bones = np.diff(points[:, 1:].reshape(-1, 5, 4, 3), axis=2)
        turned = bones @ rotation.about_z(np.radians(self.yaw_deg)).T
        return angles_of_bones(turned, rotation.exp(HandShape.default().rest_rotvec), DAMPING)

    def check(self, motion: Motion) -> None:
        """Refuse a skeleton that lacks a joint or a channel of this mapping, by name."""
        wanted = [*self.keypoints.values(), *(entry["joint"] for entry in self.angles.values())]
        missing = sorted(set(wanted) - set(motion.names))
        if missing:
            raise InputError(
                f"the mapping names {', '.join(missing)}, which the skeleton does not have; "
                f"its joints are {', '.join(motion.names)}"
            )
        for name, entry in self.angles.items():
            channels = motion.channels[motion.index(entry["joint"])]
            if entry["channel"] not in channels:
                raise InputError(
                    f"the mapping reads {name} from {entry['channel']} of {entry['joint']}, "
                    f"whose channels are {', '.join(channels) or 'none'}"
                )

    def positions_mm(self, motion: Motion) -> Array:
        """The 21 keypoints ``(F, 21, 3)`` in mm in the motion's own axes."""
        world = motion.world()
        points = np.empty((motion.n_frames, len(KEYPOINT_NAMES), 3))
        for name, joint in self.keypoints.items():
            points[:, KEYPOINT_NAMES.index(name)] = world.joints[:, motion.index(joint)]
        for d, tip in enumerate(_TIPS):
            last = _JOINTS[3 + 3 * d]
            j = motion.index(self.keypoints[last])
            reach = self._last_bone(motion, j, d)
            points[:, KEYPOINT_NAMES.index(tip)] = world.joints[:, j] + world.R[:, j] @ reach
        return points * self.unit_mm

    def _last_bone(self, motion: Motion, joint: int, digit: int) -> Array:
        ends = motion.end_offsets[motion.end_parents == joint]
        if len(ends) and np.linalg.norm(ends[0]) > 0:
            return ends[0]
        if not self.tip_mm:
            raise InputError(
                f"the End Site of {motion.names[joint]} is at zero: the mapping needs 'tip_mm'"
            )
        before = motion.offsets[joint]
        return before / np.linalg.norm(before) * self.tip_mm[digit] / self.unit_mm

    def _by_channels(self, motion: Motion) -> Array:
        left = is_left(motion) if any(e["flips_on_left"] for e in self.angles.values()) else False
        theta = np.empty((motion.n_frames, len(ANGLE_NAMES)))
        for k, name in enumerate(ANGLE_NAMES):
            entry = self.angles[name]
            j = motion.index(entry["joint"])
            column = motion.columns(j).start + motion.channels[j].index(entry["channel"])
            sign = entry["sign"] * (-1 if left and entry["flips_on_left"] else 1)
            theta[:, k] = sign * motion.values[:, column] + entry["offset_deg"]
        return np.radians(theta)


def is_left(motion: Motion) -> bool:
    """Whether a skeleton of ours is a left hand: its index knuckle lies on the palm's -x side."""
    world = motion.world()
    across = world.joints[0, motion.index("index_mcp")] - world.joints[0, motion.index("wrist")]
    return bool(world.R[0, motion.index("wrist"), :, 0] @ across < 0)


def in_palm_frame(points: ArrayLike) -> Array:
    """Keypoints ``(F, 21, 3)`` in any axes, in the palm frame of a right hand.

    Which side of the palm is its front is decided once for all frames, by the curl of the fingers.
    """
    X = np.asarray(points, float) - np.asarray(points, float)[:, :1]
    y = _unit(X[:, 9])
    normal = _unit(np.cross(X[:, 5] - X[:, 17], y))
    x = _unit(X[:, 5] - X[:, 17] - y * ((X[:, 5] - X[:, 17]) * y).sum(-1, keepdims=True))
    first, second = _unit(X[:, 6::4] - X[:, 5::4]), _unit(X[:, 7::4] - X[:, 6::4])
    curl = (np.cross(first, second) * np.cross(y, normal)[:, None]).sum(-1)  # (F, 4)
    z = normal * (1.0 if curl.sum() >= 0 else -1.0)
    return np.einsum("fba,fkb->fka", np.stack([x, y, z], axis=-1), X)


def read_mapping(name_or_path: str | Path) -> Mapping:
    """A shipped mapping by its name (``manipnet``, ``handtrack``), or one from a TOML file.

    Raises
    ------
    InputError
        There is no such file, or it is not a mapping: it names a key, an angle or a keypoint that
        is not known, or leaves one out.
    """
    try:
        if str(name_or_path) in SHIPPED:
            folder = resources.files("handtrack.mocap").joinpath("data")
            text = folder.joinpath(f"{name_or_path}.toml").read_text(encoding="utf-8")
        else:
            text = Path(name_or_path).read_text(encoding="utf-8")
        return _parse(tomllib.loads(text))
    except OSError as error:
        raise InputError(
            f"{name_or_path}: cannot read the mapping ({error.strerror}); "
            f"shipped ones are {', '.join(SHIPPED)}"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{name_or_path}: not a TOML file ({error})") from error
    except InputError as error:
        raise InputError(f"{name_or_path}: {error}") from error


def _parse(document: dict[str, Any]) -> Mapping:
    if document.pop("format", None) != "handtrack-mapping":
        raise InputError("not a mapping (its 'format' is not 'handtrack-mapping')")
    _exactly("key", set(document), {f.name for f in fields(Mapping)}, required={"skeleton"})
    if ("keypoints" in document) == ("angles" in document):
        raise InputError("a mapping has either [keypoints] or [angles]")
    if "keypoints" in document:
        _exactly("keypoint", set(document["keypoints"]), set(_JOINTS), required=set(_JOINTS))
    else:
        _exactly("angle", set(document["angles"]), set(ANGLE_NAMES), required=set(ANGLE_NAMES))
        for name, entry in document["angles"].items():
            _exactly(f"{name} key", set(entry), _ANGLE_KEYS, required={"joint", "channel"})
            document["angles"][name] = {
                "sign": 1.0,
                "offset_deg": 0.0,
                "flips_on_left": False,
            } | entry
    if len(tips := document.get("tip_mm", ())) not in (0, len(DIGITS)):
        raise InputError(f"'tip_mm' has {len(tips)} lengths, wanted {len(DIGITS)}")
    try:
        return Mapping(**(document | {"tip_mm": tuple(float(tip) for tip in tips)}))
    except (TypeError, ValueError) as error:
        raise InputError(str(error)) from error


def _exactly(kind: str, have: set[str], known: set[str], required: set[str]) -> None:
    for problem, names in (("unknown", have - known), ("missing", required - have)):
        if names:
            raise InputError(f"{problem} {kind} {', '.join(sorted(names))}")


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, 1e-12)
