"""What a method says of one frame, and what it starts from: pose and angles with their spread."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Palm pose and angles of the tracked (right-hand) model.

    ``theta_std`` is the spread of each angle in radians; ``ess`` the effective sample size of
    whatever was sampled; ``energy`` compares estimates of one frame by one method.
    """

    pose: Pose
    theta: Array  # (20,)
    theta_std: Array  # (20,)
    ess: float = np.nan
    energy: float = np.nan

    def __post_init__(self) -> None:
        freeze_arrays(self)
