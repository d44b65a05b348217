"""The recorded motion that ships with the package, put together from pieces of recordings.

``data/motion.toml`` lists the pieces; each is brought to one rate, lightly smoothed, and joined
to the next by a blend ``10 s^3 - 15 s^4 + 6 s^5``. Angles are stored as hundredths of a degree.

>>> minimum_jerk(np.array([0.0, 0.5, 1.0])).tolist()
[0.0, 0.5, 1.0]
"""

import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from handtrack.errors import InputError, OutputError
from handtrack.mocap.recordings import Recording, resampled

Array = NDArray[np.float64]

#: Standard deviation of the smoothing, which takes the sensors' noise out and little else.
SMOOTHING_S = 0.03


def excerpt(recordings: list[Recording]) -> tuple[Array, float]:
    """Angles ``(n, 20)`` in radians of the pieces that ``motion.toml`` lists, and their rate in Hz.

    Raises
    ------
    InputError
        A recording that the list names is not among ``recordings``.
    """
    folder = resources.files("handtrack.mocap").joinpath("data")
    plan = tomllib.loads(folder.joinpath("motion.toml").read_text(encoding="utf-8"))
    known = {recording.name: recording for recording in recordings}
    rate_hz = float(plan["rate_hz"])
    parts: list[Array] = []
    for piece in plan["piece"]:
        if piece["recording"] not in known:
            raise InputError(f"no recording '{piece['recording']}' in the folders given")
        part = _piece(known[piece["recording"]], slice(*piece["frames"]), rate_hz)
        if parts:
            parts.append(_blend(parts[-1][-1], part[0], round(plan["blend_s"] * rate_hz)))
        parts.append(part)
    return np.concatenate(parts), rate_hz


def save_excerpt(path: str | Path, recordings: list[Recording]) -> int:
    """Write the excerpt for :func:`handtrack.mocap.recordings.shipped_motion`; number of frames.

    Raises
    ------
    InputError, OutputError
        As :func:`excerpt`; the file cannot be written.
    """
    theta, rate_hz = excerpt(recordings)
    used = {(r.source, r.licence) for r in recordings}
    try:
        np.savez_compressed(
            path,
            theta_cdeg=np.round(np.degrees(theta) * 100).astype(np.int16),
            rate_hz=np.float64(rate_hz),
            name=np.str_("splay, point, grab, pinch, count, tap, gun, flap, fist, wave"),
            source=np.str_(", ".join(sorted(source for source, _ in used))),
            licence=np.str_(", ".join(sorted({licence for _, licence in used}))),
        )
    except OSError as error:
        raise OutputError(f"{path}: cannot write the motion ({error.strerror})") from error
    return len(theta)


def minimum_jerk(s: Array) -> Array:
    """From 0 at ``s = 0`` to 1 at ``s = 1``, at rest at both ends."""
    return s**3 * (10 - 15 * s + 6 * s**2)


def _piece(recording: Recording, frames: slice, rate_hz: float) -> Array:
    if np.isnan(recording.time_s).all():
        theta = recording.clean[frames]
    else:
        first, last = recording.time_s[frames][[0, -1]].tolist()
        times = np.arange(first, last, 1 / rate_hz)
        theta = resampled(recording, times)
    return gaussian_filter1d(theta, SMOOTHING_S * rate_hz, axis=0)


def _blend(before: Array, after: Array, n: int) -> Array:
    s = minimum_jerk(np.arange(1, n + 1) / (n + 1))[:, None]
    return before + s * (after - before)
