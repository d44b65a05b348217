"""BVH: a skeleton and its motion, read and written without losing anything.

A file is a tree of joints, each with an ``OFFSET`` from its parent and a list of ``CHANNELS``,
then one line of channel values a frame (:mod:`handtrack.mocap.motion` says what they mean).
Everything is kept, frame time, channel order and End Sites included. Lengths have no unit in the
format; a mapping (:mod:`handtrack.mocap.mapping`) states it.

>>> motion = parse_bvh('''HIERARCHY
... ROOT wrist
... {
...   OFFSET 0 0 0
...   CHANNELS 1 Zrotation
...   End Site
...   {
...     OFFSET 10 0 0
...   }
... }
... MOTION
... Frames: 2
... Frame Time: 0.01
... 0
... 90
... ''')
>>> motion.world().ends.round(6)[:, 0].tolist()
[[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]
>>> parse_bvh(format_bvh(motion)).values.tolist()
[[0.0], [90.0]]
"""

import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, OutputError
from handtrack.mocap.motion import CHANNELS, Motion, World

__all__ = ["Motion", "World", "format_bvh", "parse_bvh", "read_bvh", "write_bvh"]

Array = NDArray[np.float64]

_CHANNELS = {name.lower(): name for name in CHANNELS}


def read_bvh(path: str | Path) -> Motion:
    """Read a BVH file.

    Raises
    ------
    InputError
        The file cannot be read, is not BVH, is cut short, or a motion line has another number
        of values than the skeleton has channels; the message names the line.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the file ({error.strerror})") from error
    try:
        return parse_bvh(_decoded(content))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _decoded(content: bytes) -> str:
    """Text of a file: UTF-8, or else Latin-1, in which old files name their joints."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def write_bvh(motion: Motion, path: str | Path) -> None:
    """Write a BVH file that reads back to the same numbers, whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    target = Path(path)
    try:
        handle, draft = tempfile.mkstemp(suffix=".part", dir=target.parent)
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(format_bvh(motion))
            os.chmod(draft, 0o644)
            os.replace(draft, target)
        except BaseException:
            os.unlink(draft)
            raise
    except OSError as error:
        raise OutputError(f"{path}: cannot write the motion ({error.strerror})") from error


def format_bvh(motion: Motion) -> str:
    """The text of a BVH file; numbers in their shortest form that reads back exactly."""
    lines = ["HIERARCHY"]
    for j in np.flatnonzero(motion.parents < 0):
        lines += _joint_lines(motion, int(j), 0)
    lines += ["MOTION", f"Frames: {motion.n_frames}", f"Frame Time: {motion.frame_time_s!r}"]
    values = motion.values[:, _columns_as_written(motion)]
    lines += [" ".join(map(repr, row)) for row in values.tolist()]
    return "\n".join(lines) + "\n"


def _columns_as_written(motion: Motion) -> list[int]:
    """Columns of ``values`` in the order of the joints in the file: depth first."""
    order: list[int] = []
    stack = np.flatnonzero(motion.parents < 0)[::-1].tolist()
    while stack:
        order.append(stack.pop())
        stack += np.flatnonzero(motion.parents == order[-1])[::-1].tolist()
    columns = np.arange(motion.values.shape[1])
    return [int(c) for j in order for c in columns[motion.columns(j)]]


def _joint_lines(motion: Motion, j: int, depth: int) -> Iterator[str]:
    tab = "\t" * depth
    yield f"{tab}{'ROOT' if motion.parents[j] < 0 else 'JOINT'} {motion.names[j]}"
    yield f"{tab}{{"
    yield f"{tab}\tOFFSET {_numbers(motion.offsets[j])}"
    channels = motion.channels[j]
    yield f"{tab}\tCHANNELS {' '.join((str(len(channels)), *channels))}"
    for child in np.flatnonzero(motion.parents == j):
        yield from _joint_lines(motion, int(child), depth + 1)
    for e in np.flatnonzero(motion.end_parents == j):
        yield f"{tab}\tEnd Site"
        yield f"{tab}\t{{"
        yield f"{tab}\t\tOFFSET {_numbers(motion.end_offsets[e])}"
        yield f"{tab}\t}}"
    yield f"{tab}}}"


def _numbers(values: Array) -> str:
    return " ".join(map(repr, values.tolist()))


def parse_bvh(text: str) -> Motion:
    """The motion in the text of a BVH file; :func:`read_bvh` says what can go wrong."""
    lines = text.splitlines()
    if not lines or not lines[0].strip().upper().startswith("HIERARCHY"):
        raise InputError("not a BVH file (it does not begin with HIERARCHY)")
    starts = [n for n, line in enumerate(lines) if line.strip().upper() == "MOTION"]
    if not starts:
        raise InputError("the file ends before MOTION: it is cut short or holds a skeleton only")
    skeleton = _Skeleton(lines[: starts[0]])
    frame_time_s, values = _parse_motion(lines, starts[0], sum(map(len, skeleton.channels)))
    return Motion(
        names=tuple(skeleton.names),
        parents=np.array(skeleton.parents, dtype=np.int64),
        offsets=np.array(skeleton.offsets, dtype=float).reshape(-1, 3),
        channels=tuple(skeleton.channels),
        end_parents=np.array(skeleton.end_parents, dtype=np.int64),
        end_offsets=np.array(skeleton.end_offsets, dtype=float).reshape(-1, 3),
        frame_time_s=frame_time_s,
        values=values,
    )


class _Skeleton:
    """Reads the lines from HIERARCHY to MOTION; ``open`` is the stack of blocks not yet closed.

    A block on the stack is the index of a joint, or ``_END`` for an End Site.
    """

    _END = -2

    def __init__(self, lines: list[str]) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[tuple[str, ...]] = []
        self.end_parents: list[int] = []
        self.end_offsets: list[list[float]] = []
        self.open: list[int] = []
        for number, line in enumerate(lines[1:], start=2):
            for part in re.findall(r"[{}]|[^{}]+", line):
                if part.strip():
                    try:
                        self._take(part.split())
                    except (ValueError, IndexError) as error:
                        raise InputError(f"line {number}: cannot read '{line.strip()}'") from error
        if self.open or not self.names:
            raise InputError("the skeleton is not closed: the file is damaged or cut short")

    def _take(self, words: list[str]) -> None:
        keyword, *rest = words
        match keyword.upper():
            case "ROOT" | "JOINT":
                self.names.append(" ".join(rest) or _refuse())
                self.parents.append(self.open[-1] if keyword.upper() == "JOINT" else -1)
                self.offsets.append([0.0, 0.0, 0.0])
                self.channels.append(())
                self.open.append(len(self.names) - 1)
            case "END":
                self.end_parents.append(self.open[-1])
                self.end_offsets.append([0.0, 0.0, 0.0])
                self.open.append(self._END)
            case "OFFSET":
                offset = [float(word) for word in rest]
                if len(offset) != 3 or not np.isfinite(offset).all():
                    _refuse()
                if self.open[-1] == self._END:
                    self.end_offsets[-1] = offset
                else:
                    self.offsets[self.open[-1]] = offset
            case "CHANNELS":
                names = tuple(_CHANNELS.get(word.lower()) or _refuse() for word in rest[1:])
                if len(names) != int(rest[0]) or self.open[-1] == self._END:
                    _refuse()
                self.channels[self.open[-1]] = names
            case "{":
                self.open[-1]  # a brace opens what a line before it named
            case "}":
                self.open.pop()
            case _:
                _refuse()


def _refuse() -> str:
    raise ValueError


def _parse_motion(lines: list[str], start: int, n_channels: int) -> tuple[float, Array]:
    """Frame time and ``(F, C)`` values of the lines after ``lines[start]``, which is MOTION."""
    head = " ".join(lines[start + 1 : start + 3])
    found = re.fullmatch(r"\s*Frames:\s*(\d+)\s+Frame Time:\s*(\S+)\s*", head, re.IGNORECASE)
    frame_time_s = _positive(found[2]) if found else None
    if found is None or frame_time_s is None:
        raise InputError(f"line {start + 2}: wanted 'Frames: N' and 'Frame Time: seconds'")
    rows = [(n, w) for n, line in enumerate(lines[start + 3 :], start + 4) if (w := line.split())]
    n_frames = int(found[1])
    if len(rows) < n_frames:
        raise InputError(
            f"the file is cut short: it ends after {len(rows)} of the {n_frames} frames it states"
        )
    if len(rows) > n_frames:
        raise InputError(f"line {rows[n_frames][0]}: a motion line beyond the {n_frames} stated")
    for number, words in rows:
        if len(words) != n_channels:
            raise InputError(
                f"line {number}: {len(words)} values, but the skeleton has {n_channels} channels"
            )
    return frame_time_s, _numeric(rows, n_channels)


def _positive(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if 0 < value < np.inf else None


def _numeric(rows: list[tuple[int, list[str]]], n_channels: int) -> Array:
    flat = [word for _, words in rows for word in words]
    try:
        values = np.array(flat, dtype=float).reshape(len(rows), n_channels)
    except ValueError as error:
        for number, words in rows:
            for word in words:
                try:
                    float(word)
                except ValueError:
                    raise InputError(f"line {number}: '{word}' is not a number") from error
        raise
    if not np.isfinite(values).all():
        number = rows[int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])][0]
        raise InputError(f"line {number}: a value that is not finite")
    return values
