"""The 21 keypoints as markers, for TRC (OpenSim) and C3D (every motion capture program).

Marker programs have y up, so the camera's axes are turned upright as in the BVH
(:data:`handtrack.mocap.hand_motion.UPRIGHT`: x right, y up, z to the viewer); the origin stays in
the camera. A keypoint that is not known is an empty field in TRC and has a residual of -1 in C3D.

>>> upright_mm([[1.0, 20.0, 300.0]]).tolist()
[[1.0, -20.0, -300.0]]
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, OutputError
from handtrack.hand.skeleton import KEYPOINT_NAMES
from handtrack.mocap.hand_motion import UPRIGHT
from handtrack.mocap.marker_io import read_markers, write_markers
from handtrack.mocap.markers import Markers
from handtrack.trajectory import Trajectory

#: The header of a C3D file counts frames in 16 bits.
MOST_C3D_FRAMES = 65535


def upright_mm(points_mm: ArrayLike) -> NDArray[np.float64]:
    """Camera-frame points ``(..., 3)`` with y up, to a tenth of a micrometre."""
    return np.round(np.asarray(points_mm, float) @ UPRIGHT.T, 4) + 0.0  # no -0.0


def write_points(hand: Trajectory, rate_hz: float, path: Path) -> None:
    """Write the keypoints in the format of the suffix: ``.trc`` or ``.c3d``.

    Raises
    ------
    InputError
        It is C3D, and there are more frames than its header can count.
    OutputError
        The file cannot be written, or not all of it.
    """
    if path.suffix == ".c3d" and len(hand) > MOST_C3D_FRAMES:
        raise InputError(
            f"{len(hand)} frames are more than C3D's header can count ({MOST_C3D_FRAMES}); "
            "--rate makes fewer, trc and json take them all"
        )
    write_markers(Markers(KEYPOINT_NAMES, upright_mm(hand.keypoints_mm), rate_hz), path)
    try:
        read_markers(path)  # a full disk goes unnoticed by ezc3d
    except InputError as error:
        raise OutputError(f"{path}: was not written whole; is the disk full?") from error
