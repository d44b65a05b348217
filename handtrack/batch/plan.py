"""From what the user gave to the jobs of a batch: everything that can be refused before it begins.

The options of the runs are read with the reader of ``handtrack run`` itself, so a wrong key is
refused by name here and not once a clip. Paths become absolute: a run starts in another folder,
perhaps on another machine.
"""

import re
import uuid
from collections.abc import Sequence
from dataclasses import fields
from importlib import metadata
from pathlib import Path
from typing import Any

from handtrack.batch.job import Job
from handtrack.batch.names import folder_names
from handtrack.batch.status import plain_settings
from handtrack.cli import config_flags, parse
from handtrack.errors import InputError
from handtrack.run import RunSettings
from handtrack.toml_file import read_toml

#: Options of a run that the batch decides, and why.
OURS = {
    "out": "every clip gets a folder of its own; give --out on the command line",
    "quiet": "the batch has one progress bar for all",
    "debug": "the pictures of all clips would go to one folder",
    "debug_frames": "the pictures of all clips would go to one folder",
    "truth": "every clip has a truth of its own",
    "port": "it is of live cameras",
    "open": "it is of live cameras",
}
#: What the batch keeps in its folder while it runs.
WORK = ".batch"


def make_jobs(clips: Sequence[Path], out: Path, config: Path | None) -> list[Job]:
    """The jobs of a batch; nothing is written.

    Raises
    ------
    InputError
        There is no clip, or the settings cannot be used.
    OutputError
        A clip has no place in ``out``.
    """
    unique = list(dict.fromkeys(clip.absolute() for clip in clips))
    if not unique:
        raise InputError("no clips: name at least one file")
    flags, settings = run_options(config)
    out = out.absolute()
    work = out / WORK / uuid.uuid4().hex
    version = metadata.version("handtrack")
    names = folder_names(unique, out)
    return [Job(clip, out, names[clip], flags, settings, version, work) for clip in unique]


def run_options(config: Path | None) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Flags for ``handtrack run`` from a TOML file, and what they mean.

    Raises
    ------
    InputError
        The file cannot be read, has a key that is no option of a run or a value that it does not
        take, or an option that the batch decides.
    """
    if config is None:
        flags = []
    else:
        for key in read_toml(config):
            if (why := OURS.get(key.replace("-", "_"))) is not None:
                raise InputError(f"{config}: '{key}' is no option in a batch: {why}")
        options = {field.name: field.type for field in fields(RunSettings)}
        flags = [word for words in config_flags(config, options, set()) for word in words]
    chosen = parse(["run", "clip", *flags])
    if not isinstance(chosen, RunSettings):
        raise TypeError(f"'run' gave {type(chosen).__name__}")
    chosen.check()
    named = {f.name: getattr(chosen, f.name) for f in fields(chosen) if f.name not in OURS}
    for own in ("clip", "config"):
        del named[own]
    return tuple(_absolute(word, named) for word in flags), plain_settings(named)


def _absolute(word: str, settings: dict[str, Any]) -> str:
    """``--hand=hand.toml`` with its path seen from anywhere."""
    found = re.match(r"--([a-z-]+)=", word)
    value = settings.get(found[1].replace("-", "_")) if found else None
    return f"{found[0]}{value.absolute()}" if found and isinstance(value, Path) else word
