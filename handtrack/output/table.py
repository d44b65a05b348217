"""Tables of a trajectory: ``angles.csv`` and ``keypoints.csv``, a row for every decoded frame.

Degrees, mm, pixels and seconds, as each column's name says; a value that is not known is an
empty field. The number of decimals is fixed by the unit, so the same hand gives the same bytes.
Rows are appended as they come and the file gets its name at the end; a full disk costs the rows
that did not fit and no more.

>>> cell("time_s", 1 / 3), cell("index_pip_flexion_deg", -1e-9), cell("ess", float("nan"))
('0.333333', '0.0000', '')
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.output.files import hidden_beside, put_in_place
from handtrack.tables import ANGLES_CSV, KEYPOINTS_CSV, read_tables
from handtrack.trajectory import Trajectory

__all__ = ["ANGLES_CSV", "KEYPOINTS_CSV", "TableWriter", "cell", "read_tables"]

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
