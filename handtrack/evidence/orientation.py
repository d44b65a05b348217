"""Which way up a stored image is: the display matrix that phones write into the container.

Its linear part takes stored to shown coordinates, ``x' = a x + c y, y' = b x + d y``. Of quarter
turns and mirror images every one is a transpose (or none) followed by flips of x and y (or none).

>>> import numpy as np
>>> quarter = Orientation(transpose=True, flip_x=True)
>>> quarter.clockwise_deg, quarter.mirrored, quarter.apply(np.zeros((2, 3, 3), np.uint8)).shape
(90, False, (3, 2, 3))
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from av.video.frame import VideoFrame
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Orientation:
    """How a stored image is put upright: transpose first, then the flips."""

    transpose: bool = False
    flip_x: bool = False
    flip_y: bool = False

    @classmethod
    def of(cls, frame: VideoFrame) -> "Orientation":
        """Orientation in the display matrix of a frame: ``x' = a x + c y``, ``y' = b x + d y``."""
        data: Any = frame.side_data.get("DISPLAYMATRIX")
        if data is None:
            return cls()
        a, b, _, c, d = np.frombuffer(bytes(data), dtype=np.int32)[:5].astype(float)
        if abs(b) + abs(c) > abs(a) + abs(d):
            return cls(transpose=True, flip_x=bool(c < 0), flip_y=bool(b < 0))
        return cls(flip_x=bool(a < 0), flip_y=bool(d < 0))

    @property
    def mirrored(self) -> bool:
        """Whether it is a mirror image and not a turn."""
        return (self.transpose + self.flip_x + self.flip_y) % 2 == 1

    @property
    def clockwise_deg(self) -> int:
        """Quarter turns clockwise, in degrees (of a mirror image: before it is flipped in x)."""
        flip_x = self.flip_x != self.mirrored
        return {(0, 0): 0, (1, 1): 90, (0, 1): 180, (1, 0): 270}[int(self.transpose), int(flip_x)]

    def apply(self, image: Image) -> Image:
        """The upright image, contiguous."""
        if self.transpose:
            image = image.swapaxes(0, 1)
        step_x, step_y = (-1 if self.flip_x else 1), (-1 if self.flip_y else 1)
        return np.ascontiguousarray(image[::step_y, ::step_x])
