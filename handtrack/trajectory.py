"""The waist: a hand over time, whatever measured it and wherever it goes.

A :class:`Trajectory` holds ``F`` frames of the 20 angles, the palm pose and the 21 keypoints, with
their time stamps, status and uncertainty, as read-only arrays in which NaN is "not known".
What a method does to it is a plain function in :mod:`handtrack.smoothing`; each gives a new
trajectory and notes itself in its provenance.

>>> import numpy as np
>>> from handtrack.records import FrameResult
>>> rows = [FrameResult.unknown(k, k / 25) for k in range(4)]
>>> rows[1:] = [replace(row, theta=np.full(20, row.time_s), status=Status.TRACKED, R=np.eye(3))
...             for row in rows[1:]]  # a hand that closes at 1 rad/s, seen from the second frame on
>>> hand = Trajectory.from_results(rows)
>>> len(hand), hand.status.tolist(), hand[1:3].frame.tolist()
(4, ['lost', 'tracked', 'tracked', 'tracked'], [1, 2])
>>> hand.joint_velocity()[:, 0].round(6).tolist()
[nan, nan, 1.0, 1.0]
>>> fine = hand.resample(50.0)
>>> fine.theta[:, 0].round(6).tolist(), fine.status[:3].tolist()
([nan, nan, 0.04, 0.06, 0.08, 0.1, 0.12], ['lost', 'lost', 'tracked'])
>>> fine.smooth(0.1).provenance
mappingproxy({'steps': ['resample to 50 Hz', 'smooth 0.1 s']})
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.errors import InputError, OutputError
from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES, N_ANGLES, N_KEYPOINTS
from handtrack.records import FrameResult, Status, freeze_arrays

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

#: Shape of one frame of each field.
FRAME_SHAPES: dict[str, tuple[int, ...]] = {
    "frame": (),
    "time_s": (),
    "status": (),
    "side": (),
    "confidence": (),
    "ess": (),
    "palm_mm": (3,),
    "palm_wxyz": (4,),
    "theta": (N_ANGLES,),
    "theta_std": (N_ANGLES,),
    "keypoints_px": (N_KEYPOINTS, 2),
    "keypoints_mm": (N_KEYPOINTS, 3),
}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """``F`` frames of a hand; angles in radians, poses from palm to camera.

    Raises
    ------
    InputError
        The fields are not of one length, or have another shape than :data:`FRAME_SHAPES` says.
    """

    frame: NDArray[np.int64]  # (F,)
    time_s: Array  # (F,)
    status: NDArray[np.str_]  # (F,) values of Status
    side: NDArray[np.str_]  # (F,) "right", "left" or ""
    confidence: Array  # (F,)
    ess: Array  # (F,)
    palm_mm: Array  # (F, 3)
    palm_wxyz: Array  # (F, 4)
    theta: Array  # (F, 20)
    theta_std: Array  # (F, 20)
    keypoints_px: Array  # (F, 21, 2)
    keypoints_mm: Array  # (F, 21, 3)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.frame)
        for name, shape in FRAME_SHAPES.items():
            if (found := getattr(self, name).shape) != (n, *shape):
                raise InputError(f"trajectory: {name} has shape {found}, wanted {(n, *shape)}")
        unknown = set(self.status.tolist()) - {status.value for status in Status}
        if unknown:
            raise InputError(f"trajectory: unknown status {', '.join(sorted(unknown))}")
        freeze_arrays(self)
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    @classmethod
    def from_results(
        cls, results: Iterable[FrameResult], provenance: Mapping[str, Any] | None = None
    ) -> "Trajectory":
        """Stack what a tracker said, frame by frame."""
        rows = list(results)
        columns = {
            "frame": np.array([r.index for r in rows], np.int64),
            "status": np.array([r.status.value for r in rows], np.str_),
            "side": np.array([r.side for r in rows], np.str_),
            "palm_mm": np.array([r.t_mm for r in rows], float),
            "palm_wxyz": np.array([quaternion_of(r) for r in rows], float),
        }
        same = [name for name in FRAME_SHAPES if name not in columns]
        columns |= {name: np.array([getattr(r, name) for r in rows], float) for name in same}
        shaped = {k: columns[k].reshape(len(rows), *s) for k, s in FRAME_SHAPES.items()}
        return cls(**shaped, provenance=provenance or {})

    def __len__(self) -> int:
        return len(self.frame)

    def __getitem__(self, rows: int | slice | NDArray[Any]) -> "Trajectory":
        """The frames of a slice, a mask or an index array; one frame of a whole number.

        Rows count from 0; ``hand.frame`` has the numbers of the frames in the clip.

        Raises
        ------
        IndexError
            There is no such row.
        """
        if isinstance(rows, int | np.integer):
            k = range(len(self))[rows]
            rows = slice(k, k + 1)
        return replace(self, **{name: getattr(self, name)[rows] for name in FRAME_SHAPES})

    def __iter__(self) -> Iterator["Trajectory"]:
        """The frames one by one, each a trajectory of one frame."""
        return (self[k : k + 1] for k in range(len(self)))

    @property
    def palm_R(self) -> Array:
        """Palm to camera, ``(F, 3, 3)``; NaN where not known."""
        R = np.full((len(self), 3, 3), np.nan)
        known = np.isfinite(self.palm_wxyz).all(axis=1)
        if known.any():
            R[known] = rotation.from_quaternion(self.palm_wxyz[known])
        return R

    def is_status(self, *statuses: Status) -> NDArray[np.bool_]:
        """Mask ``(F,)`` of the frames of these statuses."""
        return np.isin(self.status, [status.value for status in statuses])

    def smooth(self, width_s: float) -> "Trajectory":
        """Everything averaged with a centred cone ``width_s`` wide; what is unknown stays so.

        Raises
        ------
        InputError
            The width is not positive, or time does not increase.
        """
        from handtrack import smoothing

        return smoothing.smooth(self, width_s)

    def bridge_gaps(self, longest_s: float) -> "Trajectory":
        """Gaps of at most ``longest_s`` filled in between; those frames become ``predicted``."""
        from handtrack import smoothing

        return smoothing.bridge_gaps(self, longest_s)

    def resample(self, rate_hz: float) -> "Trajectory":
        """At a constant rate, turns along the shortest arc; a gap stays a gap.

        Raises
        ------
        InputError
            The rate is not positive, or time does not increase.
        """
        from handtrack import smoothing

        return smoothing.resample(self, rate_hz)

    def joint_velocity(self) -> Array:
        """Velocities ``(F, 20)`` of the angles, rad/s; NaN in and beside a gap.

        Raises
        ------
        InputError
            Time does not increase.
        """
        from handtrack import smoothing

        return smoothing.joint_velocity(self)

    def save(self, path: str | Path) -> None:
        """Write everything to one ``.npz`` (no pickle in it).

        Raises
        ------
        OutputError
            It cannot be written.
        """
        arrays = {name: getattr(self, name) for name in FRAME_SHAPES}
        try:
            with open(path, "wb") as file:
                np.savez_compressed(file, **arrays, provenance=json.dumps(dict(self.provenance)))
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from error

    @classmethod
    def load(cls, path: str | Path) -> "Trajectory":
        """Read what :meth:`save` wrote, or the folder of a run or a hand-over.

        The tables of a folder are rounded (0.0001 deg, 0.0001 mm, 0.001 px); its ``run.json``
        becomes the provenance.

        Raises
        ------
        InputError
            The file is missing or is no trajectory; the folder is none of a run, or damaged.
        """
        if Path(path).is_dir():
            from handtrack.tables import read_run

            return read_run(path)
        try:
            with np.load(path, allow_pickle=False) as document:
                arrays = {name: document[name] for name in FRAME_SHAPES}
                return cls(**arrays, provenance=json.loads(str(document["provenance"])))
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such file") from error
        except (OSError, ValueError, KeyError, EOFError) as error:
            raise InputError(f"{path}: is not a trajectory ({error})") from error

    def to_dataframe(self, keypoints: bool = False) -> "pd.DataFrame":
        """The columns of ``angles.csv`` as a pandas table (degrees; NaN is not known).

        With ``keypoints`` those of ``keypoints.csv`` follow.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise InputError("to_dataframe needs pandas: pip install pandas") from error
        return pd.DataFrame(angle_columns(self) | (keypoint_columns(self) if keypoints else {}))


def angle_columns(hand: Trajectory) -> dict[str, NDArray[Any]]:
    """Names and columns ``(F,)`` of the table of angles, degrees, in their order."""
    plain = {
        k: getattr(hand, k) for k in ("frame", "time_s", "status", "side", "confidence", "ess")
    }
    place = {f"palm_{axis}_mm": hand.palm_mm[:, k] for k, axis in enumerate("xyz")}
    turn = {f"palm_q{axis}": hand.palm_wxyz[:, k] for k, axis in enumerate("wxyz")}
    theta, std = np.degrees(hand.theta), np.degrees(hand.theta_std)
    angles = {f"{name}_deg": theta[:, k] for k, name in enumerate(ANGLE_NAMES)}
    spread = {f"{name}_std_deg": std[:, k] for k, name in enumerate(ANGLE_NAMES)}
    return plain | place | turn | angles | spread


def keypoint_columns(hand: Trajectory) -> dict[str, NDArray[Any]]:
    """Names and columns ``(F,)`` of the table of keypoints, in their order."""
    columns: dict[str, NDArray[Any]] = {k: getattr(hand, k) for k in ("frame", "time_s", "status")}
    for k, name in enumerate(KEYPOINT_NAMES):
        columns |= {f"{name}_{axis}_px": hand.keypoints_px[:, k, i] for i, axis in enumerate("xy")}
        columns |= {f"{name}_{axis}_mm": hand.keypoints_mm[:, k, i] for i, axis in enumerate("xyz")}
    return columns


def quaternion_of(result: FrameResult) -> Array:
    """Palm to camera as ``(w, x, y, z)``; NaN where not known."""
    known = np.isfinite(result.R).all()
    return rotation.to_quaternion(result.R) if known else np.full(4, np.nan)
