"""Our hand as a BVH file that Blender reads, upright (:mod:`handtrack.mocap.hand_motion`).

>>> import tempfile
>>> import numpy as np
>>> path = Path(tempfile.mkdtemp()) / "motion.bvh"
>>> still = np.zeros((2, 20)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))
>>> write_hand_bvh(path, *still, HandShape.default())
>>> path.read_text().splitlines()[1]
'ROOT wrist'
"""

from pathlib import Path

from numpy.typing import ArrayLike

from handtrack.hand.shape import HandShape
from handtrack.mocap.bvh import write_bvh
from handtrack.mocap.hand_motion import UPRIGHT, hand_motion


def write_hand_bvh(
    path: str | Path,
    theta: ArrayLike,
    R: ArrayLike,
    t_mm: ArrayLike,
    shape: HandShape,
    side: str = "right",
    frame_time_s: float = 1 / 30,
    axes: ArrayLike = UPRIGHT,
) -> None:
    """Write :func:`hand_motion` to a file, whole or not at all.

    Raises
    ------
    InputError
        As :func:`hand_motion`.
    OutputError
        The file cannot be written.
    """
    write_bvh(hand_motion(theta, R, t_mm, shape, side, frame_time_s, axes), path)
