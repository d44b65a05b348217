"""A fixed-lag smoother: every answer waits until its near future is known, then takes the mean.

Each frame is solved nearly on its own, so single angles tremble by a degree or two from frame to
frame, which no hand does. A :class:`Steadier` holds results back for half a window and gives out
the mean over the window, weighted with a centred cone of full width ``w``::

    theta_k = sum_j c_jk theta_j / sum_j c_jk,   c_jk = max(0, 1 - 2 |t_j - t_k| / w)

likewise the palm's pose (turns as unit quaternions of one sign); keypoints follow from both. It is
centred, so it does not come late; it works on the frames' own time stamps; and it does not reach
over a gap, a change of hand, or a jump of the palm, which is a mistake being mended and not motion.
Status, confidence and standard deviations stay the frame's own.

>>> rows = [FrameResult.unknown(k, k / 30) for k in range(5)]
>>> steadier = Steadier(0.1, Camera.assumed_for(640, 480))
>>> [out[0].index for row in rows for out in steadier.push(row, HandShape.default(), None)]
[0, 1, 2]
>>> [out[0].index for out in steadier.flush()]
[3, 4]
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from handtrack.records import FrameResult
from handtrack.report import in_camera

Array = NDArray[np.float64]
Extra = TypeVar("Extra")

#: A palm that turns more than this from one frame to the next was found anew: that is no motion.
JUMP_DEG = 25.0
#: Frames that are held at most to either side, however quickly they come.
MOST_HELD = 16


class Waiting(NamedTuple, Generic[Extra]):
    """A result, the hand it is of, what goes with it, and whether it goes on from the last."""

    result: FrameResult
    shape: HandShape
    extra: Extra
    goes_on: bool


class Steadier(Generic[Extra]):
    """Takes results in order of time and gives them back steadied, each with what came with it.

    Parameters
    ----------
    width_s : float
        Full width of the cone in seconds; 0 gives every result back as it is, at once.
    camera : Camera
        Of the clip as filmed.
    """

    def __init__(self, width_s: float, camera: Camera) -> None:
        self.half_s, self.camera = width_s / 2, camera
        self._rows: list[Waiting[Extra]] = []  # what is held, after what its means still need
        self._given = 0  # how many of these have been given out

    def push(
        self, result: FrameResult, shape: HandShape, extra: Extra
    ) -> list[tuple[FrameResult, Extra]]:
        """Take one more result; what is ready by now, oldest first."""
        goes_on = bool(self._rows) and _of_one_motion(self._rows[-1], result, shape)
        self._rows.append(Waiting(result, shape, extra, goes_on))
        held = len(self._rows) - self._given
        ready = [
            k
            for k in range(self._given, len(self._rows))
            if self._rows[k].result.time_s + self.half_s <= result.time_s
        ]
        n = max(len(ready), held - MOST_HELD)
        return self._give(n)

    def flush(self) -> list[tuple[FrameResult, Extra]]:
        """What is still held, at the end or where the rest is not to come."""
        return self._give(len(self._rows) - self._given)

    def _give(self, n: int) -> list[tuple[FrameResult, Extra]]:
        end = self._given + n
        out = [(self._steadied(k), self._rows[k].extra) for k in range(self._given, end)]
        self._given = end
        drop = max(self._given - MOST_HELD, 0)
        if self._given < len(self._rows):
            oldest = self._rows[self._given].result.time_s - self.half_s
            while drop < self._given and self._rows[drop].result.time_s <= oldest:
                drop += 1
        self._rows, self._given = self._rows[drop:], self._given - drop
        return out

    def _steadied(self, k: int) -> FrameResult:
        here = self._rows[k].result
        rows = self._run_about(k)
        if len(rows) < 2:
            return here
        time_s = np.array([row.time_s for row in rows])
        weight = np.maximum(0.0, 1.0 - np.abs(time_s - here.time_s) / self.half_s)
        return averaged(here, rows, weight / weight.sum(), self._rows[k].shape, self.camera)

    def _run_about(self, k: int) -> list[FrameResult]:
        """The results about the ``k``-th that are within reach and of one motion with it."""
        run = [self._rows[k].result]
        for step in (-1, 1):
            j = k
            while 0 <= j + step < len(self._rows) and self._rows[max(j, j + step)].goes_on:
                j += step
                if abs(self._rows[j].result.time_s - run[0].time_s) >= self.half_s:
                    break
                run.append(self._rows[j].result)
        return run


def _of_one_motion(before: Waiting[Extra], result: FrameResult, shape: HandShape) -> bool:
    """Whether a result goes on from the one before it: no gap, no other hand, no jump."""
    one = before.result
    if not _known(one) or not _known(result):
        return False
    same = one.side == result.side and before.shape is shape
    return bool(same and rotation.angle_between(one.R, result.R) < np.radians(JUMP_DEG))


def averaged(
    here: FrameResult,
    rows: Sequence[FrameResult],
    weight: Array,
    shape: HandShape,
    camera: Camera,
) -> FrameResult:
    """``here`` with the weighted mean motion of ``rows``; ``weight`` ``(n,)`` sums to 1."""
    theta = weight @ np.array([row.theta for row in rows])
    t_mm = weight @ np.array([row.t_mm for row in rows])
    q = rotation.to_quaternion(np.array([row.R for row in rows]))
    q *= np.where(q @ q[0] < 0, -1.0, 1.0)[:, None]
    mean = weight @ q
    R = rotation.from_quaternion(mean / np.linalg.norm(mean))
    points = in_camera(theta, R, t_mm, here.side, shape)
    return replace(
        here,
        R=R,
        t_mm=t_mm,
        theta=theta,
        keypoints_mm=points,
        keypoints_px=camera.project(points),
    )


def _known(result: FrameResult) -> bool:
    return bool(np.isfinite(result.theta).all() and np.isfinite(result.R).all())
