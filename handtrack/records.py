"""The records that the stages hand to each other, and the status of a frame.

Arrays in records are read-only copies. A value that is not known is NaN.
"""

from dataclasses import dataclass, fields
from enum import Enum
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Which hand it is, and which side of it is shown.
Side = Literal["right", "left"]
Shown = Literal["palm", "back"]
OTHER_SIDE: dict[str, Side] = {"left": "right", "right": "left"}
OTHER_WAY: dict[str, Shown] = {"palm": "back", "back": "palm"}


def freeze_arrays(record: Any, copy: bool = True) -> None:
    """Replace every array of a frozen dataclass by a read-only copy (call in ``__post_init__``).

    Without ``copy`` it is a read-only view of them: for arrays that nobody else changes.
    """
    kind: Any = type(record)
    for name in _names(kind):
        value = getattr(record, name)
        if isinstance(value, np.ndarray):
            frozen = value.copy() if copy else value.view()
            frozen.setflags(write=False)
            object.__setattr__(record, name, frozen)


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


class Status(Enum):
    """What is known of the hand in one frame; ``str(status.sentence)`` is for people."""

    TRACKED = "tracked"
    PREDICTED = "predicted"
    LOST = "lost"
    UNDECODABLE = "undecodable"

    @property
    def sentence(self) -> str:
        """The status as a sentence."""
        return {
            Status.TRACKED: "the hand was seen and the model fits it",
            Status.PREDICTED: "the hand was not seen well enough; the pose is carried over",
            Status.LOST: "the hand is not known in this frame",
            Status.UNDECODABLE: "the frame could not be decoded",
        }[self]


@dataclass(frozen=True, eq=False)
class Frame:
    """One decoded frame: square pixels, upright, RGB; ``image`` is None if undecodable."""

    index: int
    time_s: float
    image: NDArray[np.uint8] | None  # (H, W, 3)


@dataclass(frozen=True, eq=False)
class Pose:
    """Palm to camera: ``X_cam = R X_palm + t_mm``."""

    R: Array  # (3, 3)
    t_mm: Array  # (3,)

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def __matmul__(self, points_mm: Array) -> Array:
        """Camera-frame points ``(..., 3)`` of palm-frame points ``(..., 3)``."""
        return points_mm @ self.R.T + self.t_mm


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What the tracker says of one frame, of the hand as filmed (a left hand is a left hand).

    ``theta`` is in radians; ``keypoints_px`` are pixels of the whole frame; ``ess`` is the
    effective sample size of the particles; everything is NaN where the status is lost.
    """

    index: int
    time_s: float
    status: Status
    side: str  # "right", "left", or "" before it is known
    confidence: float  # 0 to 1
    ess: float
    R: Array  # (3, 3) palm to camera
    t_mm: Array  # (3,)
    theta: Array  # (20,)
    theta_std: Array  # (20,)
    keypoints_px: Array  # (21, 2)
    keypoints_mm: Array  # (21, 3) in the camera frame

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def unknown(
        cls, index: int, time_s: float, status: Status = Status.LOST, side: str = ""
    ) -> "FrameResult":
        """A frame of which nothing is known."""
        return cls(
            index=index,
            time_s=time_s,
            status=status,
            side=side,
            confidence=0.0,
            ess=np.nan,
            R=np.full((3, 3), np.nan),
            t_mm=np.full(3, np.nan),
            theta=np.full(20, np.nan),
            theta_std=np.full(20, np.nan),
            keypoints_px=np.full((21, 2), np.nan),
            keypoints_mm=np.full((21, 3), np.nan),
        )
