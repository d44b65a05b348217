"""Tables of a trajectory: ``angles.csv`` and ``keypoints.csv``, a row for every decoded frame.

Degrees, mm, pixels and seconds, as each column's name says; a value that is not known is an
empty field. The number of decimals is fixed by the unit, so the same hand gives the same bytes.
Rows are appended as they come and the file gets its name at the end; a full disk costs the rows
that did not fit and no more.

>>> cell("time_s", 1 / 3), cell("index_pip_flexion_deg", -1e-9), cell("ess", float("nan"))
('0.333333', '0.0000', '')
"""

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, OutputError
from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES
from handtrack.output.files import hidden_beside, put_in_place
from handtrack.trajectory import Trajectory, angle_columns, keypoint_columns

ANGLES_CSV, KEYPOINTS_CSV = "angles.csv", "keypoints.csv"

_DECIMALS = {"s": 6, "deg": 4, "mm": 4, "px": 3, "confidence": 4, "ess": 2}
_QUATERNION_DECIMALS = 8

Columns = dict[str, NDArray[Any]]


def cell(column: str, value: Any) -> str:
    """One value as it stands in the table; empty if it is not known."""
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        return ""
    decimals = _DECIMALS.get(column.rpartition("_")[2], _QUATERNION_DECIMALS)
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0 else text


class TableWriter:
    """A CSV file that grows by pieces of a trajectory and appears when it is finished.

    Raises
    ------
    OutputError
        The file cannot be written, or not all of it; what fitted is kept.
    """

    def __init__(self, path: Path, columns: Callable[[Trajectory], Columns]) -> None:
        self._path, self._columns = path, columns
        self._part = hidden_beside(path)
        self._n_good = 0
        self._broken = False
        try:
            self._file = open(self._part, "wb", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
        self._append(",".join(columns(Trajectory.from_results([]))) + "\n")

    def write(self, hand: Trajectory) -> None:
        """Append the frames of ``hand``."""
        named = self._columns(hand)
        values = [column.tolist() for column in named.values()]
        rows = (
            ",".join(cell(n, v) for n, v in zip(named, row, strict=True))
            for row in zip(*values, strict=True)
        )
        self._append("".join(row + "\n" for row in rows))

    def finish(self) -> None:
        """Close the file and give it its name; it holds whole rows only."""
        self._file.truncate(self._n_good)
        self._file.close()
        put_in_place(self._part, self._path)

    def discard(self) -> None:
        """Leave nothing behind."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def _append(self, text: str) -> None:
        left = memoryview(text.encode())
        try:
            while left and not self._broken:
                left = left[self._file.write(left) or 0 :]
        except OSError as error:
            self._broken = True
            raise OutputError(f"{self._path}: cannot be written ({error.strerror})") from error
        self._n_good = self._file.tell()


def read_tables(folder: str | Path) -> Trajectory:
    """The trajectory in the two tables of ``folder``.

    Raises
    ------
    InputError
        A table is missing, has other columns, or a value is no number.
    """
    angles = _read(Path(folder) / ANGLES_CSV, angle_columns)
    points = _read(Path(folder) / KEYPOINTS_CSV, keypoint_columns)
    if angles["frame"] != points["frame"]:
        raise InputError(f"{folder}: {ANGLES_CSV} and {KEYPOINTS_CSV} are of different frames")
    try:
        return _trajectory(angles, points)
    except ValueError as error:
        raise InputError(f"{folder}: a value in the tables is no number ({error})") from error


def _trajectory(angles: dict[str, list[str]], points: dict[str, list[str]]) -> Trajectory:
    def numbers(table: dict[str, list[str]], names: list[str]) -> NDArray[np.float64]:
        return np.array([[float(x or "nan") for x in table[n]] for n in names]).T

    def keypoints(axes: str, unit: str) -> NDArray[np.float64]:
        names = [f"{name}_{axis}_{unit}" for name in KEYPOINT_NAMES for axis in axes]
        return numbers(points, names).reshape(-1, len(KEYPOINT_NAMES), len(axes))

    return Trajectory(
        frame=np.array(angles["frame"], dtype=np.int64),
        time_s=numbers(angles, ["time_s"])[:, 0],
        status=np.array(angles["status"], dtype=np.str_),
        side=np.array(angles["side"], dtype=np.str_),
        confidence=numbers(angles, ["confidence"])[:, 0],
        ess=numbers(angles, ["ess"])[:, 0],
        palm_mm=numbers(angles, [f"palm_{axis}_mm" for axis in "xyz"]),
        palm_wxyz=numbers(angles, [f"palm_q{axis}" for axis in "wxyz"]),
        theta=np.radians(numbers(angles, [f"{name}_deg" for name in ANGLE_NAMES])),
        theta_std=np.radians(numbers(angles, [f"{name}_std_deg" for name in ANGLE_NAMES])),
        keypoints_px=keypoints("xy", "px"),
        keypoints_mm=keypoints("xyz", "mm"),
    )


def _read(path: Path, columns: Callable[[Trajectory], Columns]) -> dict[str, list[str]]:
    """The columns of a table as text."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            header, *rows = list(csv.reader(file)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    wanted = list(columns(Trajectory.from_results([])))
    if header != wanted:
        missing = sorted(set(wanted) - set(header)) or ["none, but their order is another"]
        raise InputError(f"{path}: has other columns than a table of ours (missing: {missing[0]})")
    if any(len(row) != len(wanted) for row in rows):
        raise InputError(f"{path}: a row has not {len(wanted)} fields")
    return {name: [row[k] for row in rows] for k, name in enumerate(header)}
