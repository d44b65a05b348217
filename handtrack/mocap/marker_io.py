"""Marker files: read by what they say, written whole or not at all.

======  ==============================  =============================================
suffix  format                          unit of length
======  ==============================  =============================================
.c3d    C3D (:mod:`handtrack.mocap.c3d`)  ``POINT:UNITS``
.trc    TRC of Cortex and OpenSim       the ``Units`` column of its header
.tsv    Qualisys Track Manager          mm, by definition of the format
.csv    ``time_s`` and ``<marker>_x_mm``  in the column names (``_mm``, ``_cm``, ``_m``)
======  ==============================  =============================================

A missing marker is NaN here; on disk it is what the format uses (a residual of -1 in C3D, empty
fields in the texts). What is read is mm, whatever the file holds.
"""

import contextlib
import csv
import io
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, OutputError
from handtrack.mocap.c3d import read_c3d, write_c3d
from handtrack.mocap.markers import UNITS_MM, Markers

Array = NDArray[np.float64]

SUFFIXES = (".c3d", ".trc", ".tsv", ".csv")


def read_markers(path: str | Path) -> Markers:
    """Read a marker file of any of the formats.

    Raises
    ------
    InputError
        The file cannot be read, is none of the formats, is cut short, or does not state its unit.
    """
    source = Path(path)
    try:
        match source.suffix.lower():
            case ".c3d":
                return read_c3d(source)
            case ".trc":
                return _parse_trc(_text(source))
            case ".tsv":
                return _parse_tsv(_text(source))
            case ".csv":
                return _parse_csv(_text(source))
        raise InputError(f"'{source.suffix}' is no marker format; known: {', '.join(SUFFIXES)}")
    except OSError as error:
        reason = error.strerror or "not readable"
        raise InputError(f"{path}: cannot read the markers ({reason})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a {source.suffix} file (it is not text)") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def write_markers(markers: Markers, path: str | Path) -> None:
    """Write markers in the format of the file's suffix, in mm, whole or not at all.

    Raises
    ------
    InputError
        The suffix is none of the formats.
    OutputError
        The file cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: no marker format; known: {', '.join(SUFFIXES)}")
    try:
        with _draft(target) as draft:
            if suffix == ".c3d":
                write_c3d(markers, draft)
            else:
                form = {".trc": _format_trc, ".tsv": _format_tsv, ".csv": _format_csv}[suffix]
                draft.write_text(form(markers), encoding="utf-8", newline="")
    except OSError as error:
        raise OutputError(f"{path}: cannot write the markers ({error.strerror})") from error


@contextlib.contextmanager
def _draft(target: Path) -> Iterator[Path]:
    """A path to write to, which becomes ``target`` when all went well."""
    # ezc3d insists on the suffix
    handle, name = tempfile.mkstemp(".part" + target.suffix.lower(), dir=target.parent)
    os.close(handle)
    draft = Path(name)
    try:
        yield draft
        draft.chmod(0o644)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8-sig")


def _parse_trc(text: str) -> Markers:
    lines = [line.rstrip("\r") for line in text.split("\n")]
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise InputError("not a TRC file (it does not begin with PathFileType), or cut short")
    keys, values = lines[1].split("\t"), lines[2].split("\t")
    head = dict(zip((key.strip() for key in keys), values, strict=False))
    if "Units" not in head or "DataRate" not in head or "NumFrames" not in head:
        raise InputError("its header lacks Units, DataRate or NumFrames")
    labels = [word.strip() for word in lines[3].split("\t")[2:] if word.strip()]
    rows = [line.split("\t")[2:] for line in lines[5:] if line.strip()]
    stated = int(_number(head["NumFrames"], "NumFrames"))
    _whole(len(rows), stated)
    rate = _number(head["DataRate"], "DataRate")
    return _markers(labels, _table(rows, len(labels)), rate, head["Units"].strip())


def _format_trc(markers: Markers) -> str:
    F, M = markers.n_frames, len(markers.labels)
    rate = repr(float(markers.rate_hz))
    head = [
        "PathFileType\t4\t(X/Y/Z)\tmarkers.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate}\t{rate}\t{F}\t{M}\tmm\t{rate}\t1\t{F}",
        "Frame#\tTime\t" + "\t\t\t".join(markers.labels),
        "\t\t" + "\t".join(f"{axis}{m + 1}" for m in range(M) for axis in "XYZ"),
        "",
    ]
    rows = zip(_times(markers), _fields(markers), strict=True)
    body = [f"{f + 1}\t{time}\t" + "\t".join(row) for f, (time, row) in enumerate(rows)]
    # OpenSim takes no notice of a last cell that is empty, so that one gets its own tab
    closed = [line + "\t" if line.endswith("\t") else line for line in body]
    return "\n".join([*head, *closed]) + "\n"


def _parse_tsv(text: str) -> Markers:
    lines = text.splitlines()
    head: dict[str, list[str]] = {}
    start = 0
    for start, line in enumerate(lines):  # noqa: B007 (used after the loop)
        words = line.split("\t")
        if not re.fullmatch(r"[A-Z_]+", words[0]):
            break
        head[words[0]] = words[1:]
    if not {"MARKER_NAMES", "FREQUENCY", "NO_OF_FRAMES"} <= set(head):
        raise InputError("not a Qualisys TSV (no MARKER_NAMES, FREQUENCY or NO_OF_FRAMES)")
    labels = [name for name in head["MARKER_NAMES"] if name]
    rows = [line.split("\t") for line in lines[start:] if line.strip()]
    leading = 0
    if rows and rows[0][0].strip().lower() == "frame":
        leading = 2 if rows[0][1].strip().lower() == "time" else 1
        rows = rows[1:]
    elif rows and len(rows[0]) >= 3 * len(labels) + 2 and not _axis_title(rows[0]):
        leading = 2
    elif rows and _axis_title(rows[0]):
        rows = rows[1:]
    _whole(len(rows), int(_number(head["NO_OF_FRAMES"][0], "NO_OF_FRAMES")))
    table = _table([row[leading:] for row in rows], len(labels))
    table[(table == 0).all(axis=-1)] = np.nan  # how Qualisys writes a missing marker
    return _markers(labels, table, _number(head["FREQUENCY"][0], "FREQUENCY"), "mm")


def _axis_title(words: list[str]) -> bool:
    return any(word.strip().endswith((" X", " Y", " Z")) for word in words)


def _format_tsv(markers: Markers) -> str:
    head = [
        f"NO_OF_FRAMES\t{markers.n_frames}",
        f"NO_OF_MARKERS\t{len(markers.labels)}",
        f"FREQUENCY\t{float(markers.rate_hz)!r}",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(markers.labels),
        "Frame\tTime\t" + "\t".join(f"{m} {axis}" for m in markers.labels for axis in "XYZ"),
    ]
    rows = zip(_times(markers), _fields(markers), strict=True)
    body = [f"{f + 1}\t{time}\t" + "\t".join(row) for f, (time, row) in enumerate(rows)]
    return "\n".join([*head, *body]) + "\n"


def _parse_csv(text: str) -> Markers:
    rows = list(csv.reader(io.StringIO(text)))
    if not rows or "time_s" not in rows[0]:
        raise InputError("the table has no column 'time_s'")
    title = rows[0]
    found = [re.fullmatch(r"(.+)_x_(\w+)", name) for name in title]
    first = {m[1]: (k, m[2]) for k, m in enumerate(found) if m}
    units = {unit for _, unit in first.values()}
    if len(units) != 1:
        raise InputError(
            "marker columns must be named like 'index_tip_x_mm', all in one unit "
            f"(found {', '.join(sorted(units)) or 'none'})"
        )
    unit = units.pop()
    columns = []
    for label in first:
        for axis in "xyz":
            name = f"{label}_{axis}_{unit}"
            if name not in title:
                raise InputError(f"column '{name}' is missing")
            columns.append(title.index(name))
    body = [row for row in rows[1:] if row]
    if any(len(row) != len(title) for row in body):
        raise InputError(f"a line does not have {len(title)} fields: the table is damaged")
    times = np.array([_number(row[title.index("time_s")], "time_s") for row in body])
    if len(times) < 2:
        raise InputError("a table of markers needs two frames or more to have a rate")
    steps = np.diff(times)
    if steps.min() <= 0 or np.ptp(steps) > 0.5 * np.median(steps):
        raise InputError("the times in 'time_s' are not evenly spaced and increasing")
    rate = round((len(times) - 1) / float(times[-1] - times[0]), 6)
    table = _table([[row[c] for c in columns] for row in body], len(first))
    return _markers(list(first), table, rate, unit)


def _format_csv(markers: Markers) -> str:
    title = ["time_s", *(f"{m}_{axis}_mm" for m in markers.labels for axis in "xyz")]
    rows = zip(_times(markers), _fields(markers), strict=True)
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([title, *([t, *row] for t, row in rows)])
    return out.getvalue()


def _times(markers: Markers) -> list[str]:
    return [f"{f / markers.rate_hz:.6f}" for f in range(markers.n_frames)]


def _fields(markers: Markers) -> Iterator[list[str]]:
    """The ``3 M`` numbers of each frame, as short as they read back exactly; missing is empty."""
    seen = markers.seen.repeat(3, axis=1)
    for row, known in zip(
        markers.positions_mm.reshape(markers.n_frames, -1).tolist(), seen, strict=True
    ):
        yield [repr(x) if ok else "" for x, ok in zip(row, known, strict=True)]


def _table(rows: list[list[str]], n_markers: int) -> Array:
    """Positions ``(F, M, 3)`` of rows of words; empty, NaN or cut off at the end is missing."""
    table = np.full((len(rows), 3 * n_markers), np.nan)
    for f, row in enumerate(rows):
        words = row[: 3 * n_markers]
        extra = [word for word in row[3 * n_markers :] if word.strip()]
        if extra:
            raise InputError(f"frame {f + 1} has more numbers than {n_markers} markers need")
        try:
            table[f, : len(words)] = [float(w) if w.strip() else np.nan for w in words]
        except ValueError as error:
            raise InputError(f"frame {f + 1}: {error}") from error
    return table.reshape(-1, n_markers, 3)


def _markers(labels: list[str], table: Array, rate: float, unit: str) -> Markers:
    if unit.lower() not in UNITS_MM:
        raise InputError(f"unknown unit of length '{unit}'; known: {', '.join(UNITS_MM)}")
    positions = table * UNITS_MM[unit.lower()]
    positions[~np.isfinite(positions).all(axis=-1)] = np.nan
    return Markers(tuple(labels), positions, rate, unit.lower())


def _whole(found: int, stated: int) -> None:
    if found < stated:
        raise InputError(f"cut short: it ends after {found} of the {stated} frames it states")


def _number(word: str, name: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise InputError(f"{name} is '{word}', which is not a number") from error
