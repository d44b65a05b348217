"""The numbers of the whole clip: kept frame by frame in a file, packed as columns at the end.

Angles in hundredths of a degree; ``t`` never goes back, as an axis must not.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.hand.skeleton import N_ANGLES
from handtrack.layers import FrameLayers
from handtrack.output.report.columns import Column
from handtrack.records import FrameResult, Status, freeze_arrays

Array = NDArray[np.float64]

STATUSES = tuple(status.value for status in Status)
SIDES = ("", "right", "left")
#: Steps of one degree, and of one radian of the configuration space.
DEGREE_STEPS, X_STEPS = 100, 1000
_SCALARS = ("frame", "t", "status", "side", "confidence", "ess", "energy", "log_likelihood")
_WIDTH = len(_SCALARS) + 2 + 2 * N_ANGLES + 42


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """What is true of each frame of a clip."""

    theta: Array  # (F, 20)
    keypoints_px: Array  # (F, 21, 2)

    def __post_init__(self) -> None:
        freeze_arrays(self)


class Curves:
    """Takes the frames as they come.

    Raises
    ------
    OutputError
        They cannot be kept.
    """

    def __init__(self, kept: Path) -> None:
        self._kept = kept
        self.n = 0
        try:
            self._file = open(kept, "w+b")  # noqa: SIM115
        except OSError as error:
            raise OutputError(f"{kept}: cannot be written ({error.strerror})") from error

    def add(self, result: FrameResult, layers: FrameLayers) -> None:
        """One more frame."""
        scalars = [
            *(result.index, result.time_s),
            *(STATUSES.index(result.status.value), SIDES.index(result.side)),
            *(result.confidence, result.ess, layers.energy, layers.log_likelihood),
        ]
        row = np.concatenate(
            [scalars, layers.X, result.theta, result.theta_std, result.keypoints_px.ravel()]
        )
        try:
            self._file.write(row.tobytes())
        except OSError as error:
            raise OutputError(f"{self._kept}: cannot be written ({error.strerror})") from error
        self.n += 1

    def columns(self, truth: TrueMotion | None) -> list[Column]:
        """Everything, column by column."""
        self._file.flush()
        if not self.n:
            return []
        rows = np.memmap(self._kept, dtype=float, mode="r").reshape(-1, _WIDTH)
        columns = _scalars(rows)
        at = len(_SCALARS)
        columns += [Column.quantised(f"X{k}", rows[:, at + k], X_STEPS) for k in range(2)]
        at += 2
        for name in ("theta", "std"):
            degrees = (np.degrees(rows[:, at + k]) for k in range(N_ANGLES))
            columns += [
                Column.quantised(f"{name}{k}", c, DEGREE_STEPS) for k, c in enumerate(degrees)
            ]
            at += N_ANGLES
        if truth is not None:
            columns += _truth(rows, truth, at)
        return columns

    def discard(self) -> None:
        """Leave nothing behind."""
        try:
            self._file.close()
        finally:
            self._kept.unlink(missing_ok=True)


def _scalars(rows: Array) -> list[Column]:
    values = dict(zip(_SCALARS, rows.T, strict=False))
    return [
        Column.plain("frame", "i32", values["frame"], delta=True),
        Column.plain("t", "f64", np.maximum.accumulate(np.nan_to_num(values["t"]))),
        Column.plain("status", "u8", values["status"]),
        Column.plain("side", "u8", values["side"]),
        Column.quantised("confidence", values["confidence"], 10_000),
        *(Column.plain(name, "f32", values[name]) for name in _SCALARS[5:]),
    ]


def _truth(rows: Array, truth: TrueMotion, at: int) -> list[Column]:
    """True angles, and true keypoints with the mean distance to them; NaN where none is given."""
    index = rows[:, 0].astype(int)
    given = (index >= 0) & (index < len(truth.theta))
    row = np.where(given, index, 0)
    theta = np.where(given[:, None], np.degrees(truth.theta[row]), np.nan)
    columns = [Column.quantised(f"truth{k}", theta[:, k], DEGREE_STEPS) for k in range(N_ANGLES)]
    px = np.where(given[:, None, None], truth.keypoints_px[row], np.nan)
    off = np.linalg.norm(rows[:, at : at + 42].reshape(-1, 21, 2) - px, axis=-1).mean(axis=1)
    columns.append(Column.plain("keypoint_error", "f32", off))
    columns += [Column.quantised(f"true_{axis}", px[..., i], 4) for i, axis in enumerate("xy")]
    return columns
