"""What a tracker said, or what is true, frame by frame: the one record that metrics compare.

Any tracker can be read: a CSV with a column ``frame`` and ``<keypoint>_x_px, _y_px`` and, where it
has them, ``<keypoint>_x_mm, _y_mm, _z_mm`` (any unit, any origin, OpenCV's axes). A frame that is
missing, or whose fields are empty, is a frame that was not tracked.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Track:
    """``F`` consecutive frames, from frame 0; NaN is "not known"."""

    keypoints_px: Array  # (F, 21, 2)
    keypoints_mm: Array  # (F, 21, 3) camera frame
    theta: Array  # (F, 20) radians
    theta_std: Array  # (F, 20) radians
    shown: NDArray[np.bool_]  # (F,) truth: the hand is in the image; a tracker: it says "tracked"

    def __post_init__(self) -> None:
        n = len(self.keypoints_px)
        wanted = {"keypoints_px": (21, 2), "keypoints_mm": (21, 3), "theta": (20,)}
        wanted |= {"theta_std": (20,), "shown": ()}
        for name, shape in wanted.items():
            if (found := getattr(self, name).shape) != (n, *shape):
                raise InputError(f"track: {name} has shape {found}, wanted {(n, *shape)}")
        freeze_arrays(self)

    def __len__(self) -> int:
        return len(self.keypoints_px)


def read_truth(path: str | Path) -> Track:
    """The ``truth.npz`` that ``handtrack synth`` writes beside a clip.

    Raises
    ------
    InputError
        It is missing or is something else.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            theta = data["theta"]
            return Track(
                keypoints_px=data["keypoints_px"],
                keypoints_mm=data["keypoints_mm"],
                theta=theta,
                theta_std=np.zeros_like(theta),
                shown=data["visible"],
            )
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not the truth of a synthetic clip ({error})") from error


def read_track(keypoints_csv: str | Path, frames: int) -> Track:
    """A tracker's keypoints, padded or cut to ``frames``; its angles too, if they lie beside.

    Parameters
    ----------
    keypoints_csv : path
        The table of keypoints; ``angles.csv`` in the same folder is read if it is there.
    frames : int
        How many frames the truth has.

    Raises
    ------
    InputError
        The table cannot be read, or lacks a keypoint.
    """
    path = Path(keypoints_csv)
    rows = _rows(path)
    missing = [n for n in KEYPOINT_NAMES if rows and f"{n}_x_px" not in rows[0]]
    if missing or not rows:
        raise InputError(f"{path}: no column {missing[0]}_x_px" if missing else f"{path}: no rows")
    px = _fill(rows, [f"{n}_{a}_px" for n in KEYPOINT_NAMES for a in "xy"], frames, path)
    mm = _fill(rows, [f"{n}_{a}_mm" for n in KEYPOINT_NAMES for a in "xyz"], frames, path)
    shown = np.asarray(np.isfinite(px).all(axis=1))
    for row in rows:
        if 0 <= (k := int(row["frame"])) < frames:
            shown[k] &= row.get("status", "tracked") == "tracked"
    angles = path.with_name("angles.csv")
    beside = _rows(angles) if path.name == "keypoints.csv" and angles.is_file() else []
    theta = _fill(beside, [f"{n}_deg" for n in ANGLE_NAMES], frames, angles)
    std = _fill(beside, [f"{n}_std_deg" for n in ANGLE_NAMES], frames, angles)
    return Track(
        px.reshape(-1, 21, 2), mm.reshape(-1, 21, 3), np.radians(theta), np.radians(std), shown
    )


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if rows and "frame" not in rows[0]:
        raise InputError(f"{path}: no column 'frame'")
    return rows


def _fill(rows: list[dict[str, str]], columns: list[str], frames: int, path: Path) -> Array:
    """Values ``(frames, columns)`` by frame number; NaN where a field is empty or missing."""
    table = np.full((frames, len(columns)), np.nan)
    try:
        for row in rows:
            if 0 <= (k := int(row["frame"])) < frames:
                table[k] = [float(row.get(name) or "nan") for name in columns]
    except ValueError as error:
        raise InputError(f"{path}: a value is no number ({error})") from error
    return table
