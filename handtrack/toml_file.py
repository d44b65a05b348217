"""Our small TOML files: read with every complaint in one line, written with a format and version.

>>> import tempfile
>>> path = Path(tempfile.mkdtemp()) / "a.toml"
>>> write_document(path, "handtrack-thing", 1, {"width_px": 3})
>>> read_document(path, "handtrack-thing", 1)
{'width_px': 3}
"""

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from handtrack.errors import InputError, OutputError


def read_toml(path: str | Path) -> dict[str, Any]:
    """The table in a TOML file.

    Raises
    ------
    InputError
        The file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from error


def read_document(path: str | Path, form: str, version: int) -> dict[str, Any]:
    """The table of a file of ours, its ``format`` and ``version`` checked and taken off.

    Raises
    ------
    InputError
        As :func:`read_toml`, or it is a file of another kind or version.
    """
    document = read_toml(path)
    if (found := document.pop("format", None)) != form:
        raise InputError(f"{path}: its 'format' is {found!r}, wanted {form!r}")
    if (number := document.pop("version", None)) != version:
        raise InputError(f"{path}: version {number} of {form}, this reads version {version}")
    return document


def check_keys(path: str | Path, found: set[str], required: set[str], optional: set[str]) -> None:
    """Refuse keys that are not known or not there, by name.

    Raises
    ------
    InputError
        There is such a key.
    """
    for kind, names in (("unknown", found - required - optional), ("missing", required - found)):
        if names:
            raise InputError(f"{path}: {kind} key {', '.join(sorted(names))}")


def write_document(path: str | Path, form: str, version: int, document: dict[str, Any]) -> None:
    """Write a file of ours.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    text = tomli_w.dumps({"format": form, "version": version} | document)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
