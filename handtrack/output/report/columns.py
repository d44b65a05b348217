"""Columns of numbers as compact bytes: quantised, optionally differenced, split in byte planes.

A *block* is ``deflate(uint32 length of the head, head as JSON, columns one after another)``. The
head lists ``name``, ``type``, ``n``, ``scale`` and ``delta`` of each column; a column of two-byte
numbers stands as all its low bytes, then all its high ones, which deflates far better. In a
column of quantised numbers the least integer means "not known".

>>> block = pack_columns([Column.quantised("x", [1.0, 1.25, np.nan, 1.5], 8)])
>>> unpack_columns(block)["x"].tolist()
[1.0, 1.25, nan, 1.5]
"""

import base64
import json
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Names of the types, which the page knows too.
TYPES = {"u8": "<u1", "u16": "<u2", "i16": "<i2", "i32": "<i4", "f32": "<f4", "f64": "<f8"}
UNKNOWN_I16 = -(2**15)
DEFLATE_LEVEL = 6


@dataclass(frozen=True, eq=False)
class Column:
    """``n`` numbers of a type; ``scale`` steps make one unit, 0 for numbers that are as they are.

    ``delta``: differences of neighbours are stored (modulo the type's range).
    """

    name: str
    type: str
    values: NDArray[Any]  # (n,)
    scale: float = 0.0
    delta: bool = False

    @classmethod
    def quantised(cls, name: str, values: ArrayLike, scale: float, delta: bool = False) -> "Column":
        """Numbers in steps of ``1 / scale`` in two bytes; NaN is kept, far ones are cut off."""
        flat = np.asarray(values, float).ravel()
        far = 2**15 - 1
        with np.errstate(invalid="ignore"):
            steps = np.clip(np.round(flat * scale), -far, far)
        steps = np.where(np.isnan(flat), UNKNOWN_I16, steps)
        return cls(name, "i16", steps.astype(np.int16), scale, delta)

    @classmethod
    def plain(cls, name: str, type_: str, values: ArrayLike, delta: bool = False) -> "Column":
        """Numbers as they are."""
        return cls(name, type_, np.asarray(values).ravel().astype(TYPES[type_]), 0.0, delta)

    @property
    def head(self) -> dict[str, Any]:
        """What the page needs to read it."""
        return {
            "name": self.name,
            "type": self.type,
            "n": len(self.values),
            "scale": self.scale,
            "delta": self.delta,
        }

    @property
    def data(self) -> bytes:
        """Its bytes, plane by plane."""
        values = self.values.astype(TYPES[self.type])
        if self.delta and len(values):
            values = np.concatenate([values[:1], np.diff(values)])
        return np.ascontiguousarray(values.view(np.uint8).reshape(-1, values.itemsize).T).tobytes()


def pack_columns(columns: Iterable[Column]) -> bytes:
    """A block of columns; the same columns give the same bytes."""
    kept = list(columns)
    head = json.dumps([column.head for column in kept], separators=(",", ":")).encode()
    squeeze = zlib.compressobj(DEFLATE_LEVEL)
    pieces = [squeeze.compress(struct.pack("<I", len(head)) + head)]
    pieces += [squeeze.compress(column.data) for column in kept]
    return b"".join([*pieces, squeeze.flush()])


def unpack_columns(block: bytes) -> dict[str, NDArray[Any]]:
    """The columns of a block by name, as the page has them: in units, NaN for the unknown."""
    raw = zlib.decompress(block)
    (length,) = struct.unpack_from("<I", raw)
    at, found = 4 + length, {}
    for head in json.loads(raw[4:at]):
        kind = np.dtype(TYPES[head["type"]])
        planes = np.frombuffer(raw, np.uint8, head["n"] * kind.itemsize, at)
        at += head["n"] * kind.itemsize
        values = np.ascontiguousarray(planes.reshape(kind.itemsize, -1).T).view(kind)[:, 0]
        if head["delta"]:
            values = np.cumsum(values, dtype=kind)
        if head["scale"]:
            values = np.where(values == UNKNOWN_I16, np.nan, values / head["scale"])
        found[head["name"]] = values
    return found


def as_text(data: bytes) -> str:
    """Bytes for a script."""
    return base64.b64encode(data).decode("ascii")
