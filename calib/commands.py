"""``handtrack calibrate hand | camera | board``: files for tracking, from pictures.

>>> CalibrateBoard(square_mm=1.0)()
Traceback (most recent call last):
handtrack.errors.InputError: squares of 1 mm: wanted 2 to 500
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import cv2
import tyro
from tqdm import tqdm

from calib.board import PAPER_MM, Board
from calib.camera import CameraCalibration, calibrate_camera, collect_views
from calib.card import find_card
from calib.picture import confirmation, lines_of
from calib.search import FoundHand, best_hand, pictures_of
from handtrack.camera import Camera
from handtrack.errors import InputError, NothingUsableError, OutputError
from handtrack.evidence.video import probe
from handtrack.hand.shape import HandShape

MAX_LENS_PX = 3.0
MAX_BOARD_PICTURES = 250


@dataclass(frozen=True)
class CalibrateHand:
    """Measure a hand from a picture of its open palm, or the best frame of a clip.

    Hold the hand flat to the camera, fingers spread, thumb out, on a background of another
    colour. Writes the hand file and, beside it, a picture by which to see whether it fits.
    """

    source: tyro.conf.Positional[Path]
    """A photograph or a clip."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("hand.toml")
    """The hand file to write; the picture gets the same name with .png."""
    side: Literal["auto", "right", "left"] = "auto"
    """Which hand it is; auto tells it by the thumb."""
    facing: Literal["palm", "back"] = "palm"
    """Which side of the hand the camera sees."""
    hand_length_mm: float | None = None
    """Wrist to middle fingertip, measured with a ruler; sets the scale."""
    card: bool = False
    """A bank card lies beside the hand, as far from the camera as the palm: it sets the scale."""
    camera: Path | None = None
    """A camera file; without one a 58 degree view along the longer side is assumed."""
    frame: int | None = None
    """The frame of the clip to use; default: the best of those looked at."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Search, write, say what was found."""
        self._check()
        known = Camera.load(self.camera) if self.camera is not None else None
        pictures = tqdm(
            pictures_of(self.source, self.frame),
            desc="looking for an open palm",
            unit="frame",
            disable=True if self.quiet else None,
            leave=False,
        )
        search = best_hand(
            pictures,
            known.for_size if known is not None else Camera.assumed_for,
            side=None if self.side == "auto" else self.side,
            facing=self.facing,
            hand_length_mm=self.hand_length_mm,
        )
        if search.found is None:
            raise NothingUsableError(
                f"{self.source}: no open palm in the {search.looked_at} picture(s) looked at: "
                f"{search.reason()}"
            )
        self._write(search.found)
        return 0

    def _check(self) -> None:
        if self.hand_length_mm is not None and not 50 < self.hand_length_mm < 350:
            raise InputError(
                f"--hand-length-mm {self.hand_length_mm:g}: wanted 50 to 350, from the wrist to "
                "the tip of the middle finger"
            )
        if self.card and self.hand_length_mm is not None:
            raise InputError("--card and --hand-length-mm both set the scale: give one of them")

    def _scaled(self, found: FoundHand) -> tuple[HandShape, str]:
        """The hand at its size, and where the size comes from."""
        shape = found.result.shape
        if self.hand_length_mm is not None:
            return shape, f"a hand length of {self.hand_length_mm:g} mm"
        if not self.card:
            return shape, "the usual palm length, since one camera cannot see size"
        card = find_card(found.image, found.hand_mask())
        if card is None:
            raise NothingUsableError(
                f"{self.source}: no bank card beside the hand in frame {found.frame}: lay it flat, "
                "all of it in view, on something of another colour; or measure --hand-length-mm"
            )
        factor = card.mm_per_px / found.mm_per_px()
        if not 0.6 < factor < 1.6:
            raise NothingUsableError(
                f"{self.source}: by what looks like a card, the palm would be "
                f"{factor * shape.palm_length_mm:.0f} mm long: is there another rectangle in view?"
            )
        return shape.scaled(factor), "a bank card, 85.60 mm"

    def _write(self, found: FoundHand) -> None:
        sized, scale = self._scaled(found)
        shape = replace(
            sized,
            source=f"{self.source.name} frame {found.frame}, {found.result.side} hand, open palm; "
            f"outline within {found.result.residual_px:.2f} px; scale from {scale}",
        )
        shape.save(self.out)
        beside = self.out.with_suffix(".png")
        good, data = cv2.imencode(".png", confirmation(found, shape)[..., ::-1])
        try:
            beside.write_bytes(data.tobytes() if good else b"")
        except OSError as error:
            raise OutputError(f"{beside}: cannot write the picture ({error.strerror})") from error
        print(f"frame {found.frame}: " + "\n".join(lines_of(found, shape)))
        print(f"scale from {scale}")
        print(f"wrote {self.out} and {beside}: look at the picture before you use the file")


@dataclass(frozen=True)
class CalibrateBoard:
    """Make a board to calibrate a camera with: a PDF at true size, to be printed at 100 %.

    Glue it to something flat. Check the ruler line on the sheet, and give `calibrate camera` the
    same columns, rows and square size.
    """

    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("board.pdf")
    """The PDF to write."""
    columns: int = Board.columns
    """Squares across."""
    rows: int = Board.rows
    """Squares down."""
    square_mm: float = Board.square_mm
    """Side of a square."""
    chessboard: bool = False
    """Plain squares without markers: then all of it must be in view in every picture."""
    paper: Literal["a4", "a3", "letter"] = "a4"
    """The sheet, landscape."""

    def __call__(self) -> int:
        """Write the PDF."""
        board = Board(self.columns, self.rows, self.square_mm, not self.chessboard)
        board.save_pdf(self.out, self.paper)
        width, height = PAPER_MM[self.paper]
        print(f"wrote {self.out}: {board.describe()}, sheet {width:g} x {height:g} mm")
        return 0


@dataclass(frozen=True)
class CalibrateCamera:
    """Measure a camera's focal length and centre from a clip of a board (`calibrate board`).

    Move the board slowly: near and far, tilted each way, into all corners of the picture. Use
    the zoom and picture size with which the hands will be filmed. A set that does not tell the
    focal length well is refused with the reason.
    """

    clip: tyro.conf.Positional[Path]
    """A clip of the board."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("camera.toml")
    """The camera file to write."""
    columns: int = Board.columns
    """Squares across."""
    rows: int = Board.rows
    """Squares down."""
    square_mm: float = Board.square_mm
    """Side of a square; the camera file does not depend on it."""
    chessboard: bool = False
    """The board has no markers."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Collect views, calibrate, write."""
        board = Board(self.columns, self.rows, self.square_mm, not self.chessboard)
        info = probe(self.clip)
        pictures = tqdm(
            pictures_of(self.clip, at_most=MAX_BOARD_PICTURES),
            desc="looking for the board",
            unit="frame",
            disable=True if self.quiet else None,
            leave=False,
        )
        views, n_seen = collect_views(pictures, board)
        if not n_seen:
            raise NothingUsableError(
                f"{self.clip}: the board is in none of the frames looked at: it was to be "
                f"{board.describe()}"
            )
        try:
            found = calibrate_camera(views, board, info.width_px, info.height_px)
        except NothingUsableError as error:
            raise NothingUsableError(f"{self.clip}: {error}") from error
        self._write(found)
        return 0

    def _write(self, found: CameraCalibration) -> None:
        camera = found.camera
        source = (
            f"{self.clip.name}, {found.n_views} views of the board, "
            f"reprojection {found.reprojection_px:.3f} px"
        )
        camera.save(self.out, source)
        print(f"focal length {camera.fx_px:.1f}, {camera.fy_px:.1f} px (+- {found.focal_std:.2%})")
        print(f"principal point {camera.cx_px:.1f}, {camera.cy_px:.1f} px")
        print(f"reprojection error {found.reprojection_px:.3f} px over {found.n_views} views")
        if found.distortion_px > MAX_LENS_PX:
            print(
                f"note: the lens moves the picture's corners by {found.distortion_px:.1f} px, "
                "which tracking does not correct; keep the hand near the middle"
            )
        print(f"wrote {self.out}")
