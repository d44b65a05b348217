"""A data base that ships: the manual alphabet, and sequences that are not in it.

Key poses of the 20 angles come from ``data/alphabet.toml``. A sequence holds each for a while and
goes to the next along ``10 s^3 - 15 s^4 + 6 s^5`` (minimum jerk); joints start and arrive a
little apart, key poses and timing vary from one performance to the next, all from a seed. The
hand-over paper's data base is the alphabet twice, 52 letters.

>>> rng = np.random.default_rng(0)
>>> perform("girl", rng).shape[1], sorted(key_poses())[:3]
(20, ['1', '2', '3'])
"""

from collections.abc import Sequence
from functools import cache
from importlib import resources
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import ANGLE_NAMES, DIGITS, LIMITS
from handtrack.toml_file import read_document

Array = NDArray[np.float64]

RATE_HZ = 120.0
#: Mean duration of a hold and of a change, and how much they vary (log-normal deviation).
HOLD_S, CHANGE_S, TIMING = 0.18, 0.32, 0.22
#: Deviation of an angle of a key pose between performances: one part shared by a digit's flexions.
POSE_DEG, SHARED_DEG, ABDUCTION_DEG = 3.0, 5.0, 2.0
#: A joint may run ahead or behind by so much of the change.
STAGGER = 0.12


@cache
def _document() -> dict[str, Any]:
    with resources.as_file(resources.files("handtrack.mocap").joinpath("data")) as folder:
        return read_document(folder / "alphabet.toml", "handtrack-alphabet", 1)


@cache
def key_poses() -> dict[str, Array]:
    """Every key pose by name: angles ``(20,)`` in radians, read-only."""
    document = _document()
    return {
        name: _pose(document, entry)
        for group in ("letters", "counting", "gestures")
        for name, entry in document[group].items()
    }


def sequences() -> tuple[str, ...]:
    """Names of the sequences that ship."""
    return tuple(_document()["sequences"])


def perform(
    what: str | Sequence[str], rng: np.random.Generator, rate_hz: float = RATE_HZ, runs: int = 1
) -> Array:
    """One performance: angles ``(F, 20)`` in radians over time.

    Parameters
    ----------
    what : the name of a sequence, or key poses one by one.
    rng : where timing and variation come from.
    rate_hz : frames a second.
    runs : the sequence so many times over, each varied anew.

    Raises
    ------
    InputError
        There is no such sequence or key pose.
    """
    names = _named(what)
    poses = key_poses()
    rest = poses["rest"]
    keys = [rest, *(_varied(poses[name], rng) for _ in range(runs) for name in names), rest]
    parts = [np.tile(keys[0], (round(HOLD_S * rate_hz), 1))]
    for before, after in pairwise(keys):
        change, hold = np.array([CHANGE_S, HOLD_S]) * np.exp(rng.normal(0, TIMING, 2))
        s = np.arange(1, max(round(change * rate_hz), 2) + 1) / max(round(change * rate_hz), 2)
        ahead = rng.uniform(-STAGGER, STAGGER, 20)
        phase = np.clip((s[:, None] * (1 + 2 * STAGGER) - STAGGER) + ahead, 0, 1)
        share = phase**3 * (10 - 15 * phase + 6 * phase**2)
        parts.append(before + share * (after - before))
        parts.append(np.tile(parts[-1][-1], (max(round(hold * rate_hz), 1), 1)))
    return np.concatenate(parts)


def _named(what: str | Sequence[str]) -> list[str]:
    if isinstance(what, str):
        if what not in _document()["sequences"]:
            raise InputError(f"no sequence '{what}'; there are {', '.join(sequences())}")
        return list(_document()["sequences"][what])
    strangers = [name for name in what if name not in key_poses()]
    if strangers:
        raise InputError(f"no key pose '{strangers[0]}'; there are {', '.join(key_poses())}")
    return list(what)


def _pose(document: dict[str, Any], entry: dict[str, Any]) -> Array:
    angles = [*document["thumbs"][entry["thumb"]]]
    spread = document["spread"][entry.get("spread", "closed")]
    for finger, abduction in zip(entry["fingers"], spread, strict=True):
        mcp, pip, dip = document["fingers"][finger]
        angles += [mcp, abduction, pip, dip]
    theta = np.array(angles, float)
    for name, more in entry.get("adjust", {}).items():
        theta[ANGLE_NAMES.index(name)] += more
    theta = np.radians(theta)
    theta.setflags(write=False)
    return theta


def _varied(pose: Array, rng: np.random.Generator) -> Array:
    """The pose as it comes out this time, inside the anatomical limits."""
    own = rng.normal(0, POSE_DEG, 20)
    flexions = np.repeat(rng.normal(0, SHARED_DEG, len(DIGITS)), 4)
    abductions = np.array([name.endswith("abduction") for name in ANGLE_NAMES])
    change = np.where(abductions, rng.normal(0, ABDUCTION_DEG, 20), own + flexions)
    return np.clip(pose + np.radians(change), LIMITS[:, 0], LIMITS[:, 1])
