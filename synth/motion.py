"""How the hand moves: angles and palm pose as functions of time, all seeded.

Fingers go through *states* (each digit extended or curled, 28 of the 32 patterns) along straight
lines in angle space, timed by minimum jerk ``10 s^3 - 15 s^4 + 6 s^5``; or each joint curls on
its own (``curls``), which leaves those lines; or they replay a recording. The palm moves and
turns by sums of slow sines, scaled so that the stated limits are reached and not passed.

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

Array = NDArray[np.float64]

#: Palm to camera, fingers up.
FRONTAL = np.diag([1.0, -1.0, -1.0])
_BACK = np.diag([-1.0, 1.0, -1.0])

_OPEN_DEG = np.array(
    [[2, 6, 2, 4], [4, 6, 5, 3], [3, 0, 5, 3], [4, -5, 5, 3], [5, -7, 5, 3.0]]
).ravel()
_CURLED_DEG = np.array([[38, 8, 42, 48], *[[78, 0, 98, 58]] * 4], float).ravel()
_CURLED_DEG[[5, 9, 13, 17]] = (-1.0, 0.0, 0.5, 1.0)


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
    facing : "palm" or "back"
        Which side is shown.
    away : (float, float)
        The hand is out of the image between these shares of the clip; equal: never.
    """

    frames: int = 150
    fingers: Literal["states", "curls", "recording", "still"] = "states"
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
    facing: Literal["palm", "back"] = "palm"
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
            return np.tile(np.radians(_OPEN_DEG), (len(clock), 1))
        if self.fingers == "curls":
            return curls(rng, clock, length)
        return states(rng, clock, length, self.pace_s, start_open=self.open_frames > 0)

    def _palm(
        self, rng: np.random.Generator, clock: Array, length: float
    ) -> tuple[Array, Array, Array]:
        ramp = _minimum_jerk(clock / 0.6)[:, None] if self.open_frames else 1.0
        move = _sines(rng, clock, length, 3) * self.move_mm * ramp
        tilt = _sines(rng, clock, length, 2, together=True) * self.tilt_deg * ramp
        roll = _sines(rng, clock, length, 1) * self.roll_deg * ramp
        wrist = np.radians(_sines(rng, clock, length, 2) * self.wrist_deg)
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
        out = _minimum_jerk((share - start + 0.08) / 0.08) - _minimum_jerk((share - stop) / 0.08)
        return out[:, None] * np.array([1.2 * self.distance_mm, 0.0, 0.0])


def states(
    rng: np.random.Generator,
    clock: Array,
    length: float,
    pace_s: tuple[float, float],
    start_open: bool = True,
) -> Array:
    """Angles ``(n, 20)`` that go from state to state, each held a moment."""
    bits = [True] * 5 if start_open else _pattern(rng)
    knots, poses = [0.0], [_state(rng, bits)]
    while knots[-1] < length:
        bits = _other_pattern(rng, bits)
        knots += [knots[-1] + rng.uniform(*pace_s)]
        poses += [_state(rng, bits)]
        knots += [knots[-1] + rng.uniform(0.05, 0.3)]
        poses += [poses[-1]]
    at = np.clip(np.searchsorted(knots, clock, side="right") - 1, 0, len(knots) - 2)
    ends, pose = np.array(knots), np.array(poses)
    s = _minimum_jerk((clock - ends[at]) / (ends[at + 1] - ends[at]))[:, None]
    return pose[at] * (1 - s) + pose[at + 1] * s


def curls(rng: np.random.Generator, clock: Array, length: float) -> Array:
    """Every joint on its own: MCP, PIP and DIP of a finger are independent slow waves."""
    wave = _sines(rng, clock, length, 20, slow_hz=0.15, fast_hz=0.6)
    wave *= _minimum_jerk(clock / 0.5)[:, None]
    middle = np.array([[10, 10, 12, 15], *[[25, 0, 38, 20]] * 4]).ravel()
    reach = np.array([[16, 14, 18, 25], *[[32, 8, 42, 24]] * 4]).ravel()
    start = np.radians(_OPEN_DEG)
    blend = _minimum_jerk(clock / 0.5)[:, None]
    return start * (1 - blend) + np.radians(middle + wave * reach) * blend


def _pattern(rng: np.random.Generator) -> list[bool]:
    """Which digits are extended; the ring finger is never out alone between bent neighbours."""
    while True:
        bits = [bool(b) for b in rng.integers(0, 2, 5)]
        if not (bits[3] and not bits[2] and not bits[4]):
            return bits


def _other_pattern(rng: np.random.Generator, bits: list[bool]) -> list[bool]:
    while (new := _pattern(rng)) == bits:
        pass
    return new


def _state(rng: np.random.Generator, extended: list[bool]) -> Array:
    """The angles of a pattern, as people differ in how far they bend."""
    curl = np.repeat([0.0 if e else rng.uniform(0.82, 1.05) for e in extended], 4)
    degrees = _OPEN_DEG * (1 - curl) + _CURLED_DEG * curl + rng.normal(0, 2.0, 20)
    return np.radians(degrees)


def _minimum_jerk(s: Array) -> Array:
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _sines(
    rng: np.random.Generator,
    clock: Array,
    length: float,
    n: int,
    slow_hz: float = 0.08,
    fast_hz: float = 0.4,
    together: bool = False,
) -> Array:
    """Slow random waves ``(len(clock), n)`` whose largest value over the clip is 1."""
    rate = rng.uniform(slow_hz, fast_hz, (3, n))
    phase = rng.uniform(0, 2 * np.pi, (3, n))
    size = rng.uniform(0.4, 1.0, (3, n))

    def wave(t: Array) -> Array:
        return np.sum(size * np.sin(2 * np.pi * rate * t[:, None, None] + phase), axis=1)

    grid = wave(np.linspace(0.0, length, 400))
    peak = np.linalg.norm(grid, axis=1).max() if together else np.abs(grid).max(axis=0)
    return wave(clock) / peak
