"""Where the palm has faced of late.

A silhouette hardly tells a palm's tilt: one that is off by ten degrees is foreshortened by one and
a half percent, and fingers that make up for it hide even that. Followed from frame to frame, such a
tilt wanders. Hands do not: they are held in a way, leave it and come back to it. So the palm's
normal ``n`` (camera frame) is held near its running mean ``m``::

    E += rho(|n - m|^2 / sigma^2) k,     rho(z) = c z / (c + z)

``rho`` saturates: what the picture shows clearly, a palm that really turns, it costs little to
follow. ``k`` in 0..1 says how long ``m`` has been watched: a start of which one is not sure counts
for nothing yet. Where outlines are a guess, ``m`` may be told instead, by the picture's shading.

>>> facing = Facing(frames=60)
>>> facing.begin(np.array([0.0, 0.0, -1.0]), known=True)
>>> facing.watch(np.array([0.6, 0.0, -0.8]))
>>> facing.normal.round(2).tolist(), facing.weight
([0.01, 0.0, -1.0], 1.0)
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: A palm that faces within this of the mean faces as it did.
NEAR_RAD = np.radians(15.0)


class Facing:
    """Running mean of a palm's normal, or what is ``told`` instead of it.

    Parameters
    ----------
    frames : int
        How many frames are "of late".
    """

    def __init__(self, frames: int) -> None:
        self.frames = frames
        self.mean: Array = np.array([0.0, 0.0, -1.0])
        self.watched = 0
        self.told: Array | None = None

    @property
    def normal(self) -> Array:
        """The normal ``(3,)`` that the palm's is held near."""
        return self.mean if self.told is None else self.told

    @property
    def weight(self) -> float:
        """How much it is worth, 0 to 1."""
        return self.watched / self.frames if self.told is None else 1.0

    def begin(self, normal: Array, known: bool = False) -> None:
        """Go on from ``normal`` ``(3,)``, which is ``known`` or only guessed.

        A guess that is about where the palm has faced forgets nothing.
        """
        self.told = None
        if known or float(normal @ self.mean) < np.cos(NEAR_RAD):
            self.mean, self.watched = np.array(normal), self.frames if known else 0

    def watch(self, normal: Array) -> None:
        """Take in the normal ``(3,)`` of one more frame."""
        self.watched = min(self.watched + 1, self.frames)
        mean = self.mean + (normal - self.mean) / self.watched
        self.mean = mean / max(float(np.linalg.norm(mean)), 1e-9)
