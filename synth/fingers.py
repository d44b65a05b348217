"""What fingers do: go from state to state, curl joint by joint, or replay a recording.

*States* are the basis configurations, each digit extended or curled: 28 of the 32 patterns. The
way from one to the next is a straight line in angle space, timed by minimum jerk.
"""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from handtrack.errors import InputError
from handtrack.mocap.recordings import (
    Recording,
    read_leap,
    read_manipnet,
    resampled,
    shipped_motion,
)
from synth.waves import minimum_jerk, sines

Array = NDArray[np.float64]

OPEN_DEG = np.array(
    [[2, 6, 2, 4], [4, 6, 5, 3], [3, 0, 5, 3], [4, -5, 5, 3], [5, -7, 5, 3.0]]
).ravel()
_CURLED_DEG = np.array([[36, 27, 36, 41], *[[78, 0, 98, 58]] * 4], float).ravel()
_CURLED_DEG[[5, 9, 13, 17]] = (-1.0, 0.0, 0.5, 1.0)
#: The curled thumb lies over what is bent: its angles by whether index and middle are curled.
_THUMB_DEG = {
    (False, False): (36.0, 27.0, 36.0, 41.0),
    (True, False): (41.0, 12.0, 42.0, 42.0),
    (False, True): (24.0, 26.0, 31.0, 40.0),
    (True, True): (18.0, 36.0, 26.0, 39.0),
}

_READERS = {".json": read_leap, ".bvh": read_manipnet}
#: A recording that jumps farther than this between samples is bridged.
_JUMP = np.radians(25.0)
_BRIDGE_S = 0.5
_RATE_HZ = 60.0


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
    s = minimum_jerk((clock - ends[at]) / (ends[at + 1] - ends[at]))[:, None]
    return pose[at] * (1 - s) + pose[at + 1] * s


def curls(rng: np.random.Generator, clock: Array, length: float) -> Array:
    """Every joint on its own: MCP, PIP and DIP of a finger are independent slow waves."""
    wave = sines(rng, clock, length, 20, slow_hz=0.15, fast_hz=0.6)
    wave *= minimum_jerk(clock / 0.5)[:, None]
    middle = np.array([[10, 10, 12, 15], *[[25, 0, 38, 20]] * 4]).ravel()
    reach = np.array([[16, 14, 18, 25], *[[32, 8, 42, 24]] * 4]).ravel()
    start = np.radians(OPEN_DEG)
    blend = minimum_jerk(clock / 0.5)[:, None]
    return start * (1 - blend) + np.radians(middle + wave * reach) * blend


def _pattern(rng: np.random.Generator) -> list[bool]:
    """Which digits are extended; the ring finger is never out alone between bent neighbours."""
    while True:
        bits = [bool(b) for b in rng.integers(0, 2, 5)]
        if not (bits[3] and not bits[2] and not bits[4]):
            return bits


def some_state(rng: np.random.Generator) -> Array:
    """Angles ``(20,)`` of any of the states, as people differ in it."""
    return _state(rng, _pattern(rng))


def _other_pattern(rng: np.random.Generator, bits: list[bool]) -> list[bool]:
    while (new := _pattern(rng)) == bits:
        pass
    return new


def _state(rng: np.random.Generator, extended: list[bool]) -> Array:
    """The angles of a pattern, as people differ in how far they bend."""
    curl = np.repeat([0.0 if e else rng.uniform(0.82, 1.05) for e in extended], 4)
    curled = _CURLED_DEG.copy()
    curled[:4] = _THUMB_DEG[not extended[1], not extended[2]]
    return np.radians(OPEN_DEG * (1 - curl) + curled * curl + rng.normal(0, 2.0, 20))


def replay(rng: np.random.Generator, clock: Array, length: float, source: str) -> Array:
    """A stretch of recorded motion, begun anywhere, reached from the open hand.

    Parameters
    ----------
    source : str
        A recording (``.json`` of Leap, ``.bvh`` of ManipNet); empty for what is shipped.
    """
    theta = _continuous(recorded(source))
    needed = int(length * _RATE_HZ) + 2
    theta = np.tile(theta, (needed // len(theta) + 2, 1))
    first = int(rng.integers(0, len(theta) - needed))
    piece = theta[first : first + needed]
    at = clock * _RATE_HZ
    values = np.stack([np.interp(at, np.arange(len(piece)), column) for column in piece.T], axis=1)
    blend = minimum_jerk(clock / _BRIDGE_S)[:, None]
    return np.radians(OPEN_DEG) * (1 - blend) + values * blend


@cache
def recorded(source: str) -> Array:
    """Angles ``(n, 20)``, radians, of a recording (as in :func:`replay`) at the working rate."""
    if not source:
        recording: Recording = shipped_motion()
    elif (reader := _READERS.get(Path(source).suffix)) is None:
        raise InputError(f"{source}: not a recording; .json (Leap) and .bvh (ManipNet) are read")
    else:
        recording = max(reader(source), key=lambda hand: int(hand.ok.sum()))
    start, stop = recording.time_s[recording.ok][[0, -1]]
    return resampled(recording, np.arange(start, stop, 1 / _RATE_HZ))


def _continuous(theta: Array) -> Array:
    """Bridge jumps by minimum jerk, the end to the beginning too, and take the grain off."""
    pieces = np.split(theta, np.flatnonzero(np.abs(np.diff(theta, axis=0)).max(axis=1) > _JUMP) + 1)
    pieces = [piece for piece in pieces if len(piece) > 1]
    s = minimum_jerk(np.linspace(0, 1, int(_BRIDGE_S * _RATE_HZ)))[:, None]
    joined = []
    for piece, following in zip(pieces, [*pieces[1:], pieces[0]], strict=True):
        joined += [piece, piece[-1] * (1 - s) + following[0] * s]
    return np.asarray(gaussian_filter1d(np.concatenate(joined), 1.5, axis=0, mode="wrap"))
