"""How the hand moves: angles and palm pose as functions of time, all seeded.

Fingers are :mod:`synth.fingers`; the palm moves and turns by sums of slow sines, scaled so that
the stated limits are reached and not passed.

>>> motion = Motion(frames=30).film(np.random.default_rng(1), fps=30.0)
>>> motion.theta.shape, motion.R.shape
((30, 20), (30, 3, 3))
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handtrack.hand.skeleton import LIMITS
from synth.fingers import OPEN_DEG, curls, replay, states
from synth.waves import minimum_jerk, sines

Array = NDArray[np.float64]

#: Palm to camera, fingers up.
FRONTAL = np.diag([1.0, -1.0, -1.0])
_BACK = np.diag([-1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Film:
    """What the hand does: one row a time."""

    times_s: Array  # (n,)
    theta: Array  # (n, 20)
    R: Array  # (n, 3, 3) palm to camera
    t_mm: Array  # (n, 3) of the wrist
    wrist: Array  # (n, 2) turn of the forearm about x and z


@dataclass(frozen=True)
class Motion:
    """The motion of a scene.

    Parameters
    ----------
    frames : int
        Length of the clip.
    fingers : "states", "curls", "recording" or "still"
        What the fingers do.
    recording : str
        The recording that fingers replay; empty for the one that is shipped.
    open_frames : int
        The hand is held open and frontal this long first; 0 starts with fingers bent.
    pace_s : (float, float)
        Shortest and longest time from one state to the next.
    speed : float
        Everything happens this much faster.
    distance_mm : float
        From the camera to the hand.
    centre_mm : (float, float)
        Where the middle of the palm is held, right and down of the optical axis.
    move_mm : (float, float, float)
        Largest translation to either side, along the camera's x, y and z.
    tilt_deg : float
        Largest turn out of the image plane.
    roll_deg : float
        Largest turn in the image plane.
    lean_deg : (float, float, float)
        Constant turn about the camera's x, y and z.
    wrist_deg : float
        Largest turn of the forearm at the wrist.
    facing : "palm", "back" or "any"
        Which side is shown; of any four, one back.
    away : (float, float)
        The hand is out of the image between these shares of the clip; equal: never.
    """

    frames: int = 150
    fingers: Literal["states", "curls", "recording", "still"] = "states"
    recording: str = ""
    open_frames: int = 10
    pace_s: tuple[float, float] = (0.3, 0.8)
    speed: float = 1.0
    distance_mm: float = 440.0
    centre_mm: tuple[float, float] = (0.0, 15.0)
    move_mm: tuple[float, float, float] = (30.0, 15.0, 20.0)
    tilt_deg: float = 6.0
    roll_deg: float = 12.0
    lean_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wrist_deg: float = 8.0
    facing: Literal["palm", "back", "any"] = "palm"
    away: tuple[float, float] = (0.0, 0.0)

    def film(
        self, rng: np.random.Generator, fps: float, subframes: int = 1, shutter: float = 0.5
    ) -> Film:
        """The motion at every frame, or at ``subframes`` instants while its shutter is open."""
        span = shutter * (np.arange(subframes) / subframes - 0.5 * (subframes - 1) / subframes)
        times = ((np.arange(self.frames)[:, None] + span) / fps).ravel()
        held = self.open_frames / fps
        clock = np.maximum(times - held, 0.0) * self.speed  # stands still while the hand is open
        length = self.frames / fps * self.speed
        finger_rng, palm_rng = rng.spawn(2)
        theta = np.clip(self._fingers(finger_rng, clock, length), *LIMITS.T)
        R, t_mm, wrist = self._palm(palm_rng, clock, length)
        t_mm = t_mm + self._leave(times / (self.frames / fps))
        return Film(times, theta, R, t_mm, wrist)

    def _fingers(self, rng: np.random.Generator, clock: Array, length: float) -> Array:
        if self.fingers == "still":
            return np.tile(np.radians(OPEN_DEG), (len(clock), 1))
        if self.fingers == "recording":
            return replay(rng, clock, length, self.recording)
        if self.fingers == "curls":
            return curls(rng, clock, length)
        return states(rng, clock, length, self.pace_s, start_open=self.open_frames > 0)

    def _palm(
        self, rng: np.random.Generator, clock: Array, length: float
    ) -> tuple[Array, Array, Array]:
        ramp = minimum_jerk(clock / 0.6)[:, None] if self.open_frames else 1.0
        move = sines(rng, clock, length, 3) * self.move_mm * ramp
        tilt = sines(rng, clock, length, 2, together=True) * self.tilt_deg * ramp
        roll = sines(rng, clock, length, 1) * self.roll_deg * ramp
        wrist = np.radians(sines(rng, clock, length, 2) * self.wrist_deg)
        turn = Rotation.from_rotvec(np.radians(np.concatenate([tilt, roll], axis=1)))
        lean = Rotation.from_rotvec(np.radians(self.lean_deg))
        front = FRONTAL if self.facing == "palm" else FRONTAL @ _BACK
        R = (turn * lean).as_matrix() @ front
        middle = np.array([*self.centre_mm, self.distance_mm]) + move
        return R, middle - R @ (0.0, 75.0, 0.0), wrist

    def _leave(self, share: Array) -> Array:
        """Out to the right and back, over 8 % of the clip each way: ``(n, 3)`` mm."""
        start, stop = self.away
        if stop <= start:
            return np.zeros((len(share), 3))
        out = minimum_jerk((share - start + 0.08) / 0.08) - minimum_jerk((share - stop) / 0.08)
        return out[:, None] * np.array([1.2 * self.distance_mm, 0.0, 0.0])
