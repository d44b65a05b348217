"""C3D through ``ezc3d``, with the checks it does not make.

A C3D file is blocks of 512 bytes: a header, whose second byte is 0x50, parameters, then one record
a frame. ``ezc3d`` can loop for ever in a damaged file, so the header's account of how long the
file must be is held against its size first. ``POINT:UNITS`` is the unit of length; a residual
below zero marks a marker that was not seen.
"""

import struct
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from handtrack.errors import InputError
from handtrack.mocap.markers import UNITS_MM, Markers

_BLOCK = 512
_MAGIC = 0x50
#: The header counts frames in 16 bits; this value says only "this many or more".
_MANY_FRAMES = 65535


def read_c3d(path: Path) -> Markers:
    """Markers of a C3D file, in mm.

    Raises
    ------
    InputError
        It is empty, not C3D or cut short, holds no point, or does not state its unit.
    OSError
        It cannot be read.
    """
    _check_whole(path)
    try:
        file = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError, IndexError) as error:
        raise InputError(f"a damaged C3D file ({error})") from error
    point = file["parameters"]["POINT"]
    positions = np.array(file["data"]["points"][:3], float).transpose(2, 1, 0)
    labels = [str(label).strip() for label in _value(point, "LABELS")][: positions.shape[1]]
    if not labels or positions.size == 0:
        raise InputError("a C3D file without a marker or a frame in it")
    units = _value(point, "UNITS")
    unit = str(units[0]).strip().lower() if len(units) else ""
    if unit not in UNITS_MM:
        raise InputError(f"POINT:UNITS is '{unit}'; wanted one of {', '.join(UNITS_MM)}")
    residual = file["data"]["meta_points"]["residuals"][0].T  # (F, M)
    positions[residual < 0] = np.nan
    rate = float(file["header"]["points"]["frame_rate"])
    return Markers(tuple(labels), positions * UNITS_MM[unit], rate, unit)


def write_c3d(markers: Markers, path: Path) -> None:
    """Write markers in mm as single-precision C3D.

    Raises
    ------
    OSError
        It cannot be written.
    """
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["UNITS"]["value"] = ["mm"]
    point["RATE"]["value"] = [float(markers.rate_hz)]
    point["LABELS"]["value"] = list(markers.labels)
    points = np.ones((4, len(markers.labels), markers.n_frames))
    seen = markers.seen.T  # (M, F)
    points[:3] = np.where(seen, markers.positions_mm.transpose(2, 1, 0), 0.0)
    file["data"]["points"] = points
    # a residual of -1 is how C3D says that a point was not seen
    file["data"]["meta_points"]["residuals"] = np.where(seen, 0.0, -1.0)[None]
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, *seen.shape), bool)
    file.write(str(path))


def _value(group: dict[str, Any], name: str) -> list[Any]:
    return list(group[name]["value"]) if name in group else []


def _check_whole(path: Path) -> None:
    """Hold the size that the header implies against the size of the file."""
    size = path.stat().st_size
    if size == 0:
        raise InputError("the file is empty")
    with path.open("rb") as file:
        head = file.read(_BLOCK)
        if len(head) < _BLOCK or head[1] != _MAGIC or head[0] < 2:
            raise InputError("not a C3D file (its header is not one)")
        file.seek((head[0] - 1) * _BLOCK)
        parameters = file.read(4)
    if len(parameters) < 4:
        raise InputError("cut short: it ends before its parameters")
    order = {84: "<", 85: "<", 86: ">"}.get(parameters[3])  # Intel, DEC, MIPS
    if order is None:
        raise InputError("not a C3D file (its processor type is unknown)")
    if size < (head[0] - 1 + parameters[2]) * _BLOCK:
        raise InputError("cut short: it ends within its parameters")
    n_points, n_analog, first, last = struct.unpack(f"{order}4H", head[2:10])
    data_start = struct.unpack(f"{order}H", head[16:18])[0]
    is_float = head[12:16][1 if parameters[3] == 85 else (3 if order == "<" else 0)] & 0x80
    frame_bytes = (4 * n_points + n_analog) * (4 if is_float else 2)
    n_frames = last - first + 1 if last < _MANY_FRAMES else 0
    if data_start < 2 or n_points == 0 or last < first:
        raise InputError("a C3D file without a marker or a frame in it")
    have = (size - (data_start - 1) * _BLOCK) // max(frame_bytes, 1)
    if have < n_frames:
        raise InputError(f"cut short: it ends after {max(have, 0)} of the {n_frames} frames")
