"""Public recordings of hands, read into our 20 angles.

Three sets, each in a format of its own; all end in bone directions in the palm frame of a right
hand (left hands are mirrored), and the angles follow in closed form
(:mod:`handtrack.hand.inverse`), with the default hand's axes:

- **leap** (leapjs-playback, JSON): joint positions and the palm's own axes.
- **intel** (hand_tracking_samples, ``animbank.pose``): 17 bones with positions and quaternions. A
  bone lies along its own z axis; positions are centres of mass and are not needed.
- **manipnet** (BVH): joint positions by forward kinematics (:mod:`handtrack.mocap.mapping`).

What a set calls the palm's axis need not be the direction of the middle metacarpal; a constant
turn about z per set (``yaw``) makes the mean of the four median abductions zero.

A frame is ``ok`` if the sensor was sure of it, no angle ran faster than a hand can, none is far
outside the limits, and the bones of each digit stay near one plane.

>>> motion = shipped_motion()
>>> motion.theta.shape[1], bool(motion.ok.all()), round(1 / float(np.diff(motion.time_s).mean()))
(20, True, 30)
"""

import json
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.inverse import angles_of_bones
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.mapping import DAMPING, read_mapping
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Leap's own measure of its trust in a frame, 0 to 1; frames below are not ok.
MIN_CONFIDENCE = 0.6
#: No joint of a hand turns faster; what does is a jump of the tracker that recorded it.
MAX_SPEED_DEG_S = 2500.0
#: Angles farther outside the limits than this, or bones farther out of plane, are not ok.
MAX_OUTSIDE_DEG, MAX_OUT_OF_PLANE_DEG = 15.0, 20.0

LEAP_YAW_DEG = -9.5
INTEL_YAW_DEG = 1.8

_LEAP_JOINTS = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")
_INTEL_VALUES, _INTEL_PALM, _INTEL_DIGITS = 17 * 7, 1, slice(2, 17)


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded motion of one hand.

    Parameters
    ----------
    name : file and hand.
    side : ``"right"`` or ``"left"``, as recorded; the angles are the same for both.
    theta : (F, 20) in radians, as measured.
    time_s : (F,), NaN where the set has poses without time.
    ok : (F,) whether the frame can be trusted.
    source, licence : where it comes from, and under which licence.
    """

    name: str
    side: str
    theta: Array
    time_s: Array
    ok: NDArray[np.bool_]
    source: str
    licence: str

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def clean(self) -> Array:
        """The frames that are ok, clipped to the limits."""
        return np.clip(self.theta[self.ok], LIMITS[:, 0], LIMITS[:, 1])


def read_leap(path: str | Path) -> list[Recording]:
    """The hands in one file of leapjs-playback, the left one mirrored.

    Raises
    ------
    InputError
        The file cannot be read, is not such a file, or has no whole hand in it.
    """
    frames = _leap_frames(Path(path))
    hands: dict[str, list[tuple[float, float, Array]]] = defaultdict(list)
    try:
        for frame in frames:
            for hand in frame["hands"]:
                bones = _leap_bones(hand, frame["pointables"])
                if bones is not None:
                    time_s = frame["timestamp"] * 1e-6
                    hands[hand["type"]].append((time_s, hand.get("confidence", 1.0), bones))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a Leap Motion recording ({error!r})") from error
    if not hands:
        raise InputError(f"{path}: no whole hand in {len(frames)} frames")
    recordings = []
    for side, rows in hands.items():
        time_s, confidence, bones = (np.array(column) for column in zip(*rows, strict=True))
        recordings.append(
            _recording(
                f"{Path(path).stem} ({side})",
                side,
                bones @ rotation.about_z(np.radians(LEAP_YAW_DEG)).T,
                time_s - time_s[0],
                confidence >= MIN_CONFIDENCE,
                ("leapjs-playback", "Apache-2.0"),
            )
        )
    return recordings


def _leap_frames(path: Path) -> list[dict[str, Any]]:
    try:
        frames = json.loads(path.read_text(encoding="utf-8"))["frames"]
    except OSError as error:
        raise InputError(f"{path}: cannot read the recording ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a Leap Motion recording (JSON with 'frames')") from error
    if not isinstance(frames, list):
        raise InputError(f"{path}: not a Leap Motion recording (JSON with a list of 'frames')")
    return frames


def _leap_bones(hand: dict[str, Any], pointables: list[dict[str, Any]]) -> Array | None:
    """Bone vectors ``(5, 3, 3)`` in the right-hand palm frame; None if a digit is missing."""
    digits = {p["type"]: p for p in pointables if p["handId"] == hand["id"]}
    if set(digits) != set(range(5)):
        return None
    points = np.array([[digits[d][name] for name in _LEAP_JOINTS] for d in range(5)], float)
    y, z = np.array(hand["direction"], float), np.array(hand["palmNormal"], float)
    x = np.cross(y, z) * (-1.0 if hand["type"] == "left" else 1.0)
    return np.diff(points, axis=1) @ np.stack([x, y, z], axis=-1)


def read_intel(path: str | Path) -> list[Recording]:
    """The poses of ``animbank.pose``, or of a folder that holds it, as one recording.

    Raises
    ------
    InputError
        The file cannot be read or a line does not hold 17 bones of 7 numbers.
    """
    file = Path(path) / "animbank.pose" if Path(path).is_dir() else Path(path)
    try:
        rows = [line.split() for line in file.read_text(encoding="utf-8").splitlines() if line]
        counts = {len(row) for row in rows}
        if counts != {_INTEL_VALUES}:
            raise InputError(f"{file}: a line has {counts} numbers, wanted {_INTEL_VALUES}")
        bones = np.array(rows, dtype=float).reshape(-1, 17, 7)
    except OSError as error:
        raise InputError(f"{file}: cannot read the recording ({error.strerror})") from error
    except ValueError as error:
        raise InputError(f"{file}: not a file of poses ({error})") from error
    if not (np.linalg.norm(bones[..., 3:], axis=-1) > 0).all():  # False for NaN, too
        raise InputError(f"{file}: a bone whose quaternion is no rotation")
    R = rotation.from_quaternion(bones[..., [6, 3, 4, 5]])
    along = np.einsum("fba,fkb->fka", R[:, _INTEL_PALM], R[:, _INTEL_DIGITS, :, 2])
    ours = np.stack([along[..., 0], along[..., 2], -along[..., 1]], axis=-1)
    return [
        _recording(
            file.stem,
            "right",
            ours.reshape(-1, 5, 3, 3) @ rotation.about_z(np.radians(INTEL_YAW_DEG)).T,
            np.full(len(ours), np.nan),
            np.ones(len(ours), bool),
            ("hand_tracking_samples", "Apache-2.0"),
        )
    ]


def read_manipnet(path: str | Path) -> list[Recording]:
    """A hand of ManipNet, a BVH file, as one recording.

    Raises
    ------
    InputError
        The file cannot be read or is the motion of another skeleton.
    """
    motion = read_bvh(path)
    try:
        theta, out_of_plane = read_mapping("manipnet").theta(motion)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    time_s = np.arange(motion.n_frames, dtype=np.float64) * motion.frame_time_s
    sure = np.ones(motion.n_frames, bool)
    name = Path(path).stem
    return [
        Recording(
            name=name,
            side="left" if "left" in name else "right",
            theta=theta,
            time_s=time_s,
            ok=trusted(theta, time_s, out_of_plane, sure),
            source="ManipNet",
            licence="CC-BY-NC",
        )
    ]


#: Name of a set to its reader and the files in its folder.
READERS = {
    "leap": (read_leap, "*.json"),
    "intel": (read_intel, "*.pose"),
    "manipnet": (read_manipnet, "*.bvh"),
}


def read_folder(kind: str, folder: str | Path) -> list[Recording]:
    """All recordings of a set, ``leap``, ``intel`` or ``manipnet``, in a folder.

    Raises
    ------
    InputError
        There is no such folder, no recording in it, or one that cannot be read.
    """
    reader, pattern = READERS[kind]
    files = sorted(Path(folder).glob(pattern))
    if not files:
        raise InputError(f"{folder}: no {kind} recordings ({pattern}) in this folder")
    return [recording for file in files for recording in reader(file)]


def trusted(
    theta: Array, time_s: Array, out_of_plane: Array, sure: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which frames ``(F,)`` to trust; see the module's docstring."""
    margin = np.radians(MAX_OUTSIDE_DEG)
    inside = ((theta > LIMITS[:, 0] - margin) & (theta < LIMITS[:, 1] + margin)).all(axis=1)
    flat = (out_of_plane < np.radians(MAX_OUT_OF_PLANE_DEG)).all(axis=1)
    step = np.abs(np.diff(theta, axis=0)).max(axis=1, initial=0.0)
    jump = step > np.radians(MAX_SPEED_DEG_S) * np.diff(time_s)  # False where the time is NaN
    touched = np.zeros(len(theta), bool)
    touched[1:] |= jump
    touched[:-1] |= jump
    return sure & inside & flat & ~touched & np.isfinite(theta).all(axis=1)


def _recording(
    name: str,
    side: str,
    bones: Array,
    time_s: Array,
    sure: NDArray[np.bool_],
    source: tuple[str, str],
) -> Recording:
    rest = rotation.exp(HandShape.default().rest_rotvec)
    theta, out_of_plane = angles_of_bones(bones, rest, DAMPING)
    ok = trusted(theta, time_s, out_of_plane, sure)
    return Recording(name, side, theta, time_s, ok, *source)


def resampled(recording: Recording, times_s: ArrayLike) -> Array:
    """Angles ``(n, 20)`` at the times ``(n,)``, linear between the frames that are ok."""
    time_s, theta = recording.time_s[recording.ok], recording.clean
    times = np.asarray(times_s, float)
    return np.stack([np.interp(times, time_s, column) for column in theta.T], axis=1)


@cache
def shipped_motion() -> Recording:
    """Varied recorded motion at 30 Hz that comes with the package, one piece after another.

    From leapjs-playback and hand_tracking_samples, both Apache-2.0; ``handtrack space excerpt``
    made it (:mod:`handtrack.hand.commands`).
    """
    folder = resources.files("handtrack.mocap").joinpath("data")
    with folder.joinpath("motion.npz").open("rb") as file, np.load(file) as data:
        theta = np.radians(data["theta_cdeg"] / 100.0)
        return Recording(
            name=str(data["name"]),
            side="right",
            theta=theta,
            time_s=np.arange(len(theta)) / float(data["rate_hz"]),
            ok=np.ones(len(theta), bool),
            source=str(data["source"]),
            licence=str(data["licence"]),
        )
