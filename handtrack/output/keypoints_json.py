"""``keypoints.json``: the usual 21 keypoints of every frame, as web pages and scripts want them.

One object, a line for every frame; a value that is not known is ``null``::

    {"format": "handtrack-keypoints", "version": 1, "units": {...},
     "keypoints": ["wrist", ...], "parents": [0, 0, 1, ...],
     "frames": [
      {"frame": 0, "time_s": 0.0, "status": "tracked", "side": "right", "confidence": 0.93,
       "px": [[x, y], ...], "mm": [[x, y, z], ...]}, ...]}

``px`` are pixels of the upright frame, ``mm`` the camera's frame (x right, y down, z forward);
each holds 21 points in the order of ``keypoints``, a point that is not known is ``null``.
``parents`` is the keypoint that each one hangs on; the wrist is its own.

>>> points([[1.23456, 2.0], [float("nan"), 3.0]], 3)
[[1.235, 2.0], None]
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from handtrack.hand.skeleton import KEYPOINT_NAMES, KEYPOINT_PARENTS
from handtrack.output.files import open_whole
from handtrack.trajectory import Trajectory

FORMAT = "handtrack-keypoints"
FORMAT_VERSION = 1


def write_keypoints_json(hand: Trajectory, path: Path) -> None:
    """Write the keypoints of every frame.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    head = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "units": {"time_s": "s", "px": "pixel", "mm": "mm, camera frame"},
        "keypoints": KEYPOINT_NAMES,
        "parents": KEYPOINT_PARENTS,
    }
    with open_whole(path) as file:
        file.write(json.dumps(head)[:-1] + ',\n "frames": [\n')
        for k in range(len(hand)):
            comma = "," if k + 1 < len(hand) else ""
            file.write(f"  {json.dumps(_frame(hand, k), allow_nan=False)}{comma}\n")
        file.write(" ]}\n")


def points(values: ArrayLike, decimals: int) -> list[list[float] | None]:
    """Points ``(n, d)`` as lists; one that is not known whole is None."""
    rows = np.round(np.asarray(values, float), decimals) + 0.0  # no -0.0
    return [row if all(map(math.isfinite, row)) else None for row in rows.tolist()]


def _frame(hand: Trajectory, k: int) -> dict[str, Any]:
    return {
        "frame": int(hand.frame[k]),
        "time_s": _number(hand.time_s[k], 6),
        "status": str(hand.status[k]),
        "side": str(hand.side[k]) or None,
        "confidence": _number(hand.confidence[k], 4),
        "px": points(hand.keypoints_px[k], 3),
        "mm": points(hand.keypoints_mm[k], 4),
    }


def _number(value: float, decimals: int) -> float | None:
    return round(float(value), decimals) if math.isfinite(value) else None
