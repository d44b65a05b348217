"""A board of squares and markers (ChArUco): made as a PDF at true size, and found in pictures.

A module is an eighth of a square, so that a marker of 4 x 4 bits with its border (6 modules)
sits in the middle of a white square and every edge of the drawing lies on the module grid. The
PDF is drawn as vectors in millimetres, with a ruler to check what the printer did.

>>> board = Board(columns=7, rows=5, square_mm=30.0)
>>> board.corners_mm.shape, board.modules().shape
((24, 3), (40, 56))
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, OutputError

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

MODULES = 8
MARKER_SHARE = 6 / MODULES
#: Width and height of the sheets, mm, landscape.
PAPER_MM = {"a4": (297.0, 210.0), "a3": (420.0, 297.0), "letter": (279.4, 215.9)}
MARGIN_MM = 8.0
RULER_MM = 100


@dataclass(frozen=True)
class Board:
    """A board of ``columns`` by ``rows`` squares; ``markers`` False makes it a plain chessboard."""

    columns: int = 9
    rows: int = 6
    square_mm: float = 28.0
    markers: bool = True

    def __post_init__(self) -> None:
        n_markers = self.columns * self.rows // 2
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40 and n_markers <= 250):
            raise InputError(
                f"a board of {self.columns}x{self.rows} squares: wanted 3 to 40 each way and at "
                "most 500 in all"
            )
        if not (np.isfinite(self.square_mm) and 2 <= self.square_mm <= 500):
            raise InputError(f"squares of {self.square_mm:g} mm: wanted 2 to 500")

    @cached_property
    def charuco(self) -> "cv2.aruco.CharucoBoard":
        """OpenCV's board."""
        size = (self.columns, self.rows)
        words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
        return cv2.aruco.CharucoBoard(size, self.square_mm, MARKER_SHARE * self.square_mm, words)

    @property
    def corners_mm(self) -> Array:
        """Inner corners ``(n, 3)`` in the board's plane, row by row."""
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
        return np.asarray(flat * self.square_mm)

    def modules(self) -> NDArray[np.bool_]:
        """The drawing on its grid of modules ``(8 rows, 8 columns)``, True where it is black."""
        if not self.markers:
            squares = np.indices((self.rows, self.columns)).sum(axis=0) % 2 == 0
            return np.kron(squares, np.ones((MODULES, MODULES), bool))
        fine = 4  # pixels a module: read off at the centres
        size = (self.columns * MODULES * fine, self.rows * MODULES * fine)
        drawn = self.charuco.generateImage(size, marginSize=0, borderBits=1)
        return np.asarray(drawn[fine // 2 :: fine, fine // 2 :: fine] < 128)

    def find(self, gray: Image) -> tuple[Array, NDArray[np.int64]]:
        """Corners ``(k, 2)`` in px seen in ``gray`` ``(h, w)``, and which ``(k,)`` they are."""
        if self.markers:
            corners, which, _, _ = cv2.aruco.CharucoDetector(self.charuco).detectBoard(gray)
            if which is None or corners is None:
                return np.empty((0, 2)), np.empty(0, np.int64)
            return corners.reshape(-1, 2).astype(float), which.ravel().astype(np.int64)
        size = (self.columns - 1, self.rows - 1)
        found, corners = cv2.findChessboardCornersSB(gray, size, flags=cv2.CALIB_CB_ACCURACY)
        if not found:
            return np.empty((0, 2)), np.empty(0, np.int64)
        return corners.reshape(-1, 2).astype(float), np.arange(size[0] * size[1])

    def save_pdf(self, path: Path, paper: str = "a4") -> None:
        """Draw the board on a sheet of ``paper`` at true size.

        Raises
        ------
        InputError
            The board is larger than the sheet.
        OutputError
            The file cannot be written.
        """
        from matplotlib.backends.backend_pdf import FigureCanvasPdf

        figure = self._figure(paper)
        try:
            metadata = {"Title": self.describe(), "CreationDate": None}
            FigureCanvasPdf(figure).print_pdf(path, metadata=metadata)
        except OSError as error:
            raise OutputError(f"{path}: cannot write the board ({error.strerror})") from error

    def describe(self) -> str:
        """What the board is, as the options that make and find it."""
        kind = "ChArUco, DICT_4X4_250" if self.markers else "chessboard"
        return f"{self.columns} x {self.rows} squares of {self.square_mm:g} mm, {kind}"

    def _figure(self, paper: str):  # type: ignore[no-untyped-def]
        """A matplotlib figure whose axes are the sheet in mm."""
        from matplotlib.collections import PatchCollection
        from matplotlib.figure import Figure
        from matplotlib.patches import Rectangle

        width, height = PAPER_MM[paper]
        need = np.array([self.columns, self.rows]) * self.square_mm
        room = np.array([width - 2 * MARGIN_MM, height - 2 * MARGIN_MM - 12])
        if (need > room).any():
            raise InputError(
                f"a board of {need[0]:g} x {need[1]:g} mm does not fit on {paper} "
                f"({room[0]:g} x {room[1]:g} mm): use smaller or fewer squares"
            )
        figure = Figure(figsize=(width / 25.4, height / 25.4))
        axes = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height))
        axes.axis("off")
        left, top = (width - need[0]) / 2, height - MARGIN_MM - (room[1] - need[1]) / 2
        step = self.square_mm / MODULES
        black = [
            Rectangle((left + x * step, top - (y + 1) * step), n * step, step)
            for y, x, n in _runs(self.modules())
        ]
        axes.add_collection(PatchCollection(black, facecolor="black", edgecolor="none"))
        ruler = np.arange(0, RULER_MM + 1, 10)
        axes.plot(MARGIN_MM + 4 + ruler, np.full(len(ruler), MARGIN_MM), "k|-", lw=0.6, ms=6)
        note = f"print at 100 %: this line is {RULER_MM} mm.  {self.describe()}"
        axes.text(MARGIN_MM + RULER_MM + 10, MARGIN_MM, note, fontsize=8, va="center")
        return figure


def _runs(modules: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Horizontal runs of black: row, first column, length."""
    runs = []
    for y, row in enumerate(modules):
        change = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]])))
        runs += [(y, int(a), int(b - a)) for a, b in zip(change[::2], change[1::2], strict=True)]
    return runs
