"""What an actor draws: one instant of the hand, nothing behind it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Layer:
    """A drawn instant."""

    rgba: NDArray[np.uint8]  # (H, W, 4) premultiplied, as displayed
    skin: NDArray[np.bool_]  # (H, W) bare skin: the hand, and the forearm where it is bare
