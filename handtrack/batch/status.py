"""The status file of a clip in a batch: what was done with which input, and what came of it.

One JSON file a clip, replaced whole, so that whoever reads it while the batch runs sees one state
or the next and never half of either.

>>> ClipStatus("a.mp4", State.COMPLETE, exit_code=5).is_finished
True
>>> ClipStatus("a.mp4", State.FAILED, exit_code=2).is_finished
False
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import Enum
from pathlib import Path
from typing import Any

from handtrack.errors import InputError
from handtrack.output.files import open_whole

SUFFIX = ".status.json"
FORMAT = "handtrack-batch-clip"
FORMAT_VERSION = 1


class State(Enum):
    """How far a clip is."""

    RUNNING = "running"
    COMPLETE = "complete"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class ClipStatus:
    """What is known of one clip.

    Parameters
    ----------
    clip : str
        Absolute path of the clip.
    state : State
    input : dict
        ``bytes`` and ``sha256`` of the clip.
    settings : dict
        The settings of the run, files among them by their content.
    version : str
        Of handtrack.
    exit_code : int, optional
        What ``handtrack run`` returned; negative: the signal that ended it.
    last_line : str
        Its last line.
    seconds : float
        How long it took.
    worker : str
        Host and process that did it.
    attempts : int
        How often this was begun; a worker that died leaves one more.
    counts : dict
        Frames by status, as in ``run.json``.
    files : dict
        Size in bytes of every file of the result, or of an earlier one that is still there.
    """

    clip: str
    state: State
    input: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    version: str = ""
    exit_code: int | None = None
    last_line: str = ""
    seconds: float = 0.0
    worker: str = ""
    attempts: int = 1
    counts: dict[str, Any] = field(default_factory=dict)
    files: dict[str, int] = field(default_factory=dict)

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing more to be had from this clip with these settings."""
        return self.state is State.COMPLETE

    def is_of(self, other: "ClipStatus") -> bool:
        """Whether clip, settings and version are the same, whatever came of them."""
        mine, theirs = (
            (s.clip, s.input.get("sha256"), s.settings, s.version) for s in (self, other)
        )
        return mine == theirs

    def results_are_in(self, folder: Path) -> bool:
        """Whether every file of the result is still there, at its size."""
        paths = {folder / name: size for name, size in self.files.items()}
        return bool(paths) and all(p.is_file() and p.stat().st_size == n for p, n in paths.items())


def write_status(path: Path, status: ClipStatus) -> None:
    """Write a status file.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    document = {"format": FORMAT, "version": FORMAT_VERSION}
    record = asdict(status) | {"state": status.state.value}
    record["handtrack"] = record.pop("version")
    with open_whole(path) as file:
        file.write(json.dumps(document | record, indent=2, ensure_ascii=False) + "\n")


def read_status(path: Path) -> ClipStatus | None:
    """What a status file says; None where there is none.

    Raises
    ------
    InputError
        There is a file of that name that is no status file of ours.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it to begin anew") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"{path}: not the status of a clip (its 'format' is not '{FORMAT}')")
    if document.get("version") != FORMAT_VERSION:
        raise InputError(f"{path}: version {document.get('version')}, wanted {FORMAT_VERSION}")
    document["version"] = document.pop("handtrack", "")
    known = {f.name for f in fields(ClipStatus)}
    try:
        values = {key: value for key, value in document.items() if key in known}
        return ClipStatus(**values | {"state": State(values["state"])})
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: damaged ({error!r}); remove it to begin anew") from error


def digest_of(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file.

    Raises
    ------
    InputError
        It cannot be read.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file")
    try:
        with open(path, "rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            return {"bytes": file.tell(), "sha256": sha256}
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise InputError(f"{path}: cannot be read ({reason})") from error


def plain_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as JSON has them; a file stands for its content, wherever it lies.

    Raises
    ------
    InputError
        A file among them cannot be read.
    """
    plain = {k: digest_of(v) if isinstance(v, Path) else v for k, v in settings.items()}
    return dict(json.loads(json.dumps(plain)))
