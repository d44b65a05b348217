"""``motion.bvh`` of a run: collected frame by frame in a file, turned into BVH piece by piece.

BVH has one frame time (here the mean of the clip's own) and cannot say "unknown": an unknown frame
repeats the last known one, and frames before the first known one repeat that.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.hand.shape import HandShape
from handtrack.mocap.bvh import format_bvh
from handtrack.mocap.hand_motion import hand_motion
from handtrack.output.files import hidden_beside, open_whole
from handtrack.records import FrameResult

Array = NDArray[np.float64]

MOTION_BVH = "motion.bvh"
#: Frames that are turned into text at a time.
N_AT_A_TIME = 1000
#: Numbers kept of a frame: time, 20 angles, rotation matrix, translation.
_WIDTH = 1 + 20 + 9 + 3


class MotionWriter:
    """Takes the frames as they come; ``finish`` writes the file.

    Raises
    ------
    OutputError
        The frames cannot be kept, or the file not be written.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._kept = path, hidden_beside(path).with_suffix(".frames")
        try:
            self._file = open(self._kept, "w+b")  # noqa: SIM115
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from error

    def add(self, result: FrameResult) -> None:
        """One more frame."""
        row = np.concatenate([[result.time_s], result.theta, result.R.ravel(), result.t_mm])
        try:
            self._file.write(row.tobytes())
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror})") from error

    def finish(self, shape: HandShape, side: str) -> None:
        """Write the motion of the hand of this shape; no file where no frame is known."""
        try:
            self._file.flush()
            rows = np.memmap(self._kept, dtype=float, mode="r") if self._file.tell() else None
            if rows is not None:
                whole = rows[: len(rows) // _WIDTH * _WIDTH].reshape(-1, _WIDTH)
                self._write(whole, shape, side)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror})") from error
        finally:
            self.discard()

    def discard(self) -> None:
        """Leave nothing behind."""
        try:
            self._file.close()
        finally:
            self._kept.unlink(missing_ok=True)

    def _write(self, rows: Array, shape: HandShape, side: str) -> None:
        known = np.flatnonzero(np.isfinite(rows).all(axis=1))
        if not len(known) or side not in ("right", "left"):
            return
        step_s = (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1) if len(rows) > 1 else 0.0
        step_s = round(float(step_s), 9) if step_s > 0 else 1 / 30
        last = turns = np.zeros(1)  # whole turns, in degrees, that keep each channel continuous
        with open_whole(self._path) as file:
            for k, held in enumerate(_pieces(rows, rows[known[0]])):
                R = held[:, 21:30].reshape(-1, 3, 3)
                piece = hand_motion(held[:, 1:21], R, held[:, 30:], shape, side, step_s)
                if k:
                    turns = 360 * np.round((last - piece.values[0]) / 360)
                    turns[:3] = 0  # the position
                values = piece.values[1:] + turns
                last = values[-1]
                head, numbers = _split(format_bvh(replace(piece, values=values)))
                if k == 0:
                    file.write(head.replace(f"Frames: {len(values)}\n", f"Frames: {len(rows)}\n"))
                file.write(numbers)


def _pieces(rows: Array, last: Array) -> Iterator[Array]:
    """Some rows at a time after the one before them, each unknown one replaced by the last known.

    The first piece begins with ``last``.
    """
    for begin in range(0, len(rows), N_AT_A_TIME):
        piece = np.vstack([last, rows[begin : begin + N_AT_A_TIME]])
        known = np.isfinite(piece).all(axis=1)
        held = piece[np.maximum.accumulate(np.where(known, np.arange(len(piece)), 0))]
        last = held[-1]
        yield held


def _split(text: str) -> tuple[str, str]:
    """A BVH text up to its line of the frame time, and the numbers after it."""
    end = text.index("\n", text.index("Frame Time:")) + 1
    return text[:end], text[end:]
