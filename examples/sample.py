"""Something to try the examples on: a small drawn clip, and the folder of a run on it."""

import sys
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

from handtrack.run import RunSettings, run_clip
from synth.clip import write_clip
from synth.scene import Scene


@cache
def clip(frames: int = 16) -> Path:
    """The start of the scene ``paper``, which is drawn in software: an open hand begins to move."""
    scene = Scene.named("paper", 1)
    scene = replace(scene, motion=replace(scene.motion, frames=frames))
    folder = Path(tempfile.mkdtemp(prefix="handtrack-"))
    write_clip(scene, folder, progress=False)
    return folder / "clip.mp4"


@cache
def run() -> Path:
    """The folder that ``handtrack run`` makes of :func:`clip`."""
    out = clip().parent / "clip.handtrack"
    run_clip(RunSettings(clip(), out=out, overlay=False, report=False, quiet=True))
    return out


def argument(k: int = 1) -> Path | None:
    """What was typed on the command line, if anything."""
    return Path(sys.argv[k]) if len(sys.argv) > k else None
