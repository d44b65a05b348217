"""Which folder a clip's results go to: its stem, unless that belongs to another clip.

Two clips of one stem must not share a folder, neither in one batch nor in two batches into the
same place. A name belongs to the clip that its status file names; a clip that comes too late takes
its stem with eight digits of its path's hash, and keeps it.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from handtrack.batch.status import SUFFIX, read_status
from handtrack.errors import OutputError


def folder_names(clips: Sequence[Path], out: Path) -> dict[Path, str]:
    """A name for the folder of each of the ``clips``, no two alike whatever their case.

    Parameters
    ----------
    clips : sequence of Path
        Absolute paths, each once.
    out : Path
        Folder of the batch; what is in it is looked at, nothing is written.

    Raises
    ------
    OutputError
        Both names of a clip are taken by something that is not of this clip.
    InputError
        A status file cannot be read.
    """
    names: dict[Path, str] = {}
    for clip in sorted(clips, key=lambda clip: _owned(clip, out) is None):
        name = _owned(clip, out) or _free(clip, out, {n.casefold() for n in names.values()})
        names[clip] = name
    return {clip: names[clip] for clip in clips}


def _candidates(clip: Path) -> tuple[str, str]:
    return clip.stem, f"{clip.stem}-{hashlib.sha256(str(clip).encode()).hexdigest()[:8]}"


def _owned(clip: Path, out: Path) -> str | None:
    """The name that an earlier batch gave this clip."""
    for name in _candidates(clip):
        status = read_status(out / f"{name}{SUFFIX}")
        if status is not None and status.clip == str(clip):
            return name
    return None


def _free(clip: Path, out: Path, taken: set[str]) -> str:
    for name in _candidates(clip):
        is_there = (out / name).exists() or (out / f"{name}{SUFFIX}").exists()
        if not is_there and name.casefold() not in taken:
            return name
    raise OutputError(
        f"{out / name}: is there and not of this batch, so {clip} has no place; "
        "choose another folder with --out"
    )
