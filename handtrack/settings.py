"""What ``handtrack run`` is told: one definition of every option."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from handtrack.errors import InputError
from handtrack.evidence.video import Limits


@dataclass(frozen=True)
class RunSettings:
    """Follow the hand in a clip: tables of angles and keypoints, and an overlay film.

    Writes angles.csv, keypoints.csv, motion.bvh, overlay.mp4, report.html, hand.toml, camera.toml
    and run.json.
    Exit code: 0 complete, 2 bad input, 3 cannot write, 4 no hand found, 5 some frames could not be
    decoded, 130 interrupted (what was done is kept).
    """

    clip: tyro.conf.Positional[Path]
    """A video file, or the number of a camera (0 is the first)."""
    out: Path | None = None
    """Folder for the results; default: the clip's name with .handtrack, here."""
    hand: Path | None = None
    """A hand file (hand.toml of an earlier run, say): no calibration then."""
    camera: Path | None = None
    """A camera file; without one a 58 degree view along the longer side is assumed."""
    side: Literal["auto", "right", "left"] = "auto"
    """Which hand it is; auto tells it by the thumb."""
    facing: Literal["auto", "palm", "back"] = "auto"
    """Which side of the hand the camera sees at the start; auto: the palm, unless the fingers
    show otherwise by and by, where --side is not given either."""
    method: Literal["refined", "paper", "condensation", "random"] = "refined"
    """How the pose is found; paper is the 2002 paper's, refined goes on from there."""
    particles: int | None = None
    """Particles per frame; default: the method's own number."""
    seed: int = 0
    """Seed of all random numbers."""
    steady_s: float = 0.25
    """Steady the motion by a centred mean this wide, in seconds; 0: every frame on its own."""
    start_frame: int = 0
    """Frame to begin at; the ones before it are lost."""
    overlay: bool = True
    """Make overlay.mp4."""
    report: bool = True
    """Make report.html and the report_files beside it."""
    truth: Path | None = None
    """The truth of a synthetic clip (truth.npz or its folder), for the report to compare with."""
    quiet: bool = False
    """No progress bar."""
    debug: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for pictures of every stage; --debug alone only shows tracebacks of errors."""
    debug_frames: tuple[int, ...] = ()
    """Frames to make those pictures of; default: every 25th."""
    max_megapixels: float = 40.0
    """Refuse larger frames."""
    max_minutes: float = 180.0
    """Refuse longer clips; a camera ends there."""
    port: int = 8642
    """Of the page that shows a camera's picture; 0 takes a free one."""
    open: bool = False
    """Open that page in the browser."""
    config: Path | None = None
    """A TOML file with any of these settings; the command line beats it."""

    def __call__(self) -> int:
        """Run, print the last line, return the exit code."""
        from handtrack.run import run_clip

        report = run_clip(self)
        print(report.last_line)
        return report.exit_code

    @property
    def limits(self) -> Limits:
        """What is refused before anything is allocated."""
        return Limits(self.max_megapixels, self.max_minutes)

    def check(self) -> None:
        """Refuse what no flag's type can.

        Raises
        ------
        InputError
            A number is out of its range.
        """
        for name in ("start_frame", "seed", "steady_s"):
            if getattr(self, name) < 0:
                raise InputError(f"--{name.replace('_', '-')} {getattr(self, name)} is negative")
        if self.particles is not None and self.particles < 1:
            raise InputError(f"--particles {self.particles}: at least one is needed")
