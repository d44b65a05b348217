"""Files that appear whole: written beside their place under a hidden name, renamed at the end.

>>> import tempfile
>>> path = Path(tempfile.mkdtemp()) / "a.txt"
>>> with open_whole(path) as file:
...     _ = file.write("text")
...     path.exists()
False
>>> path.read_text()
'text'
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from handtrack.errors import OutputError


def output_folder(path: Path) -> Path:
    """Make the folder and see that it can be written to.

    Raises
    ------
    OutputError
        It cannot be made, or no file can be written in it.
    """
    trial = path / f".trial.{os.getpid()}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        trial.write_bytes(b"")
        trial.unlink()
    except OSError as error:
        raise OutputError(f"{path}: cannot write in this folder ({error.strerror})") from error
    return path


def hidden_beside(path: Path) -> Path:
    """The name under which ``path`` is written until it is whole; it keeps the suffix."""
    return path.with_name(f".{path.stem}.part.{os.getpid()}{path.suffix}")


def put_in_place(part: Path, path: Path) -> None:
    """Rename ``part`` to ``path`` in one step.

    Raises
    ------
    OutputError
        It cannot be renamed (``path`` is a folder, say).
    """
    try:
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """The hidden name to write under; what is there becomes ``path`` if the block did not fail.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    part = hidden_beside(path)
    try:
        yield part
        put_in_place(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def open_whole(path: Path) -> Iterator[IO[str]]:
    """A text file that is there after the block, and only if the block did not fail.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    with whole(path) as part, open(part, "w", encoding="utf-8", newline="") as file:
        yield file


def save_whole(path: Path, save: Callable[[Path], object]) -> None:
    """A file that ``save`` writes under the name it is given.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    with whole(path) as part:
        save(part)
