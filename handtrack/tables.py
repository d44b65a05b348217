"""Reading the folder of a run: the tables and the record that :mod:`handtrack.output` writes.

``angles.csv`` and ``keypoints.csv`` have a row for every decoded frame; an empty field is not
known. ``run.json`` says what ran on what. :meth:`handtrack.Trajectory.load` reads all three.

>>> import tempfile
>>> read_run(tempfile.mkdtemp())  # doctest: +ELLIPSIS
Traceback (most recent call last):
handtrack.errors.InputError: ...: is no folder of a run (it has no run.json)
"""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES
from handtrack.trajectory import Trajectory, angle_columns, keypoint_columns

ANGLES_CSV, KEYPOINTS_CSV, RUN_JSON = "angles.csv", "keypoints.csv", "run.json"
FORMAT = "handtrack-run"

Columns = dict[str, NDArray[Any]]


def read_run(folder: str | Path) -> Trajectory:
    """The trajectory in the folder of a run, with its record as provenance.

    Raises
    ------
    InputError
        A table or ``run.json`` is missing or damaged.
    """
    if not Path(folder, RUN_JSON).is_file():
        raise InputError(f"{folder}: is no folder of a run (it has no {RUN_JSON})")
    record = read_provenance(folder)
    return replace(read_tables(folder), provenance=record)


def read_provenance(folder: str | Path) -> dict[str, Any]:
    """What ``run.json`` in ``folder`` says.

    Raises
    ------
    InputError
        There is none, or it is not ours.
    """
    path = Path(folder) / RUN_JSON
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"{path}: not the record of a run (its 'format' is not '{FORMAT}')")
    return document


def read_tables(folder: str | Path) -> Trajectory:
    """The trajectory in the two tables of ``folder``.

    Raises
    ------
    InputError
        A table is missing, has other columns, or a value is no number.
    """
    angles = _read(Path(folder) / ANGLES_CSV, angle_columns)
    points = _read(Path(folder) / KEYPOINTS_CSV, keypoint_columns)
    if angles["frame"] != points["frame"]:
        raise InputError(f"{folder}: {ANGLES_CSV} and {KEYPOINTS_CSV} are of different frames")
    try:
        return _trajectory(angles, points)
    except ValueError as error:
        raise InputError(f"{folder}: a value in the tables is no number ({error})") from error


def _trajectory(angles: dict[str, list[str]], points: dict[str, list[str]]) -> Trajectory:
    def numbers(table: dict[str, list[str]], names: list[str]) -> NDArray[np.float64]:
        return np.array([[float(x or "nan") for x in table[n]] for n in names]).T

    def keypoints(axes: str, unit: str) -> NDArray[np.float64]:
        names = [f"{name}_{axis}_{unit}" for name in KEYPOINT_NAMES for axis in axes]
        return numbers(points, names).reshape(-1, len(KEYPOINT_NAMES), len(axes))

    return Trajectory(
        frame=np.array(angles["frame"], dtype=np.int64),
        time_s=numbers(angles, ["time_s"])[:, 0],
        status=np.array(angles["status"], dtype=np.str_),
        side=np.array(angles["side"], dtype=np.str_),
        confidence=numbers(angles, ["confidence"])[:, 0],
        ess=numbers(angles, ["ess"])[:, 0],
        palm_mm=numbers(angles, [f"palm_{axis}_mm" for axis in "xyz"]),
        palm_wxyz=numbers(angles, [f"palm_q{axis}" for axis in "wxyz"]),
        theta=np.radians(numbers(angles, [f"{name}_deg" for name in ANGLE_NAMES])),
        theta_std=np.radians(numbers(angles, [f"{name}_std_deg" for name in ANGLE_NAMES])),
        keypoints_px=keypoints("xy", "px"),
        keypoints_mm=keypoints("xyz", "mm"),
    )


def _read(path: Path, columns: Callable[[Trajectory], Columns]) -> dict[str, list[str]]:
    """The columns of a table as text."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            header, *rows = list(csv.reader(file)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    wanted = list(columns(Trajectory.from_results([])))
    if header != wanted:
        missing = sorted(set(wanted) - set(header)) or ["none, but their order is another"]
        raise InputError(f"{path}: has other columns than a table of ours (missing: {missing[0]})")
    if any(len(row) != len(wanted) for row in rows):
        raise InputError(f"{path}: a row has not {len(wanted)} fields")
    return {name: [row[k] for row in rows] for k, name in enumerate(header)}
