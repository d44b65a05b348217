"""``handtrack calibrate hand``: a photograph or clip in, ``hand.toml`` and a picture out."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import cv2
import tyro
from tqdm import tqdm

from calib.picture import confirmation, lines_of
from calib.search import FoundHand, best_hand, pictures_of
from handtrack.camera import Camera
from handtrack.errors import InputError, NothingUsableError, OutputError


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

    def _write(self, found: FoundHand) -> None:
        scale = (
            "the usual palm length, since one camera cannot see size"
            if self.hand_length_mm is None
            else f"a hand length of {self.hand_length_mm:g} mm"
        )
        shape = replace(
            found.result.shape,
            source=f"{self.source.name} frame {found.frame}, {found.result.side} hand, open palm; "
            f"outline within {found.result.residual_px:.2f} px; scale from {scale}",
        )
        shape.save(self.out)
        beside = self.out.with_suffix(".png")
        good, data = cv2.imencode(".png", confirmation(found)[..., ::-1])
        try:
            beside.write_bytes(data.tobytes() if good else b"")
        except OSError as error:
            raise OutputError(f"{beside}: cannot write the picture ({error.strerror})") from error
        print(f"frame {found.frame}: " + "\n".join(lines_of(found)))
        print(f"scale from {scale}")
        print(f"wrote {self.out} and {beside}: look at the picture before you use the file")
