"""Marker positions over time: ``M`` labelled markers, ``F`` frames, mm, NaN where not seen.

>>> markers = Markers(("tip",), np.array([[[0.0, 0, 0]], [[np.nan] * 3], [[2.0, 0, 0]]]), 100.0)
>>> markers.gaps()
[Gap(label='tip', first=1, last=1)]
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Units of length a marker file may state, in mm.
UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}


@dataclass(frozen=True)
class Gap:
    """A run of frames, both ends included, in which a marker was not seen."""

    label: str
    first: int
    last: int

    def __str__(self) -> str:
        return f"{self.label} not seen in frames {self.first} to {self.last}"


@dataclass(frozen=True, eq=False)
class Markers:
    """Labelled positions, whatever file they came from.

    Parameters
    ----------
    labels : M names, each once.
    positions_mm : (F, M, 3); a marker that was not seen is NaN in all three.
    rate_hz : frames a second.
    unit : the unit the file stated, before it became mm.

    Raises
    ------
    InputError
        Labels repeat, shapes do not fit, the rate is not positive, or nothing was ever seen.
    """

    labels: tuple[str, ...]
    positions_mm: Array
    rate_hz: float
    unit: str = "mm"

    def __post_init__(self) -> None:
        freeze_arrays(self)
        if self.positions_mm.ndim != 3 or self.positions_mm.shape[1:] != (len(self.labels), 3):
            raise InputError(
                f"{len(self.labels)} markers need positions (frames, {len(self.labels)}, 3), "
                f"not {self.positions_mm.shape}"
            )
        repeated = sorted({label for label in self.labels if self.labels.count(label) > 1})
        if repeated:
            raise InputError(f"the marker name {', '.join(repeated)} occurs more than once")
        if not np.isfinite(self.rate_hz) or self.rate_hz <= 0:
            raise InputError(f"a frame rate of {self.rate_hz} Hz; it must be positive")
        if self.n_frames == 0 or not self.labels:
            raise InputError("no frame or no marker in it")
        if not self.seen.any():
            raise InputError("no marker is seen in any frame: every position is missing")

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions_mm)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each marker was seen in each frame, ``(F, M)``."""
        return np.asarray(np.isfinite(self.positions_mm).all(axis=-1))

    def select(self, labels: Sequence[str]) -> "Markers":
        """Only these markers, in this order.

        Raises
        ------
        InputError
            One of them is not there; the message lists those there are.
        """
        missing = [label for label in labels if label not in self.labels]
        if missing:
            raise InputError(f"no marker {', '.join(missing)}; there are {', '.join(self.labels)}")
        columns = [self.labels.index(label) for label in labels]
        return replace(self, labels=tuple(labels), positions_mm=self.positions_mm[:, columns])

    def gaps(self) -> list[Gap]:
        """Every span in which a marker was not seen, marker by marker."""
        found = []
        for label, seen in zip(self.labels, self.seen.T, strict=True):
            edges = np.diff(np.concatenate([[True], seen, [True]]).astype(int))
            starts, stops = np.flatnonzero(edges < 0), np.flatnonzero(edges > 0)
            found += [Gap(label, int(a), int(b) - 1) for a, b in zip(starts, stops, strict=True)]
        return found

    def resampled(self, rate_hz: float) -> "Markers":
        """The same markers at another rate, linearly between neighbouring frames.

        A new frame is missing where either of its neighbours is.
        """
        times = np.arange(self.n_frames) / self.rate_hz
        n = int(np.floor(times[-1] * rate_hz + 1e-6)) + 1
        at = np.minimum(np.arange(n) / rate_hz, times[-1]) * self.rate_hz
        low = np.minimum(np.floor(at + 1e-9).astype(int), self.n_frames - 1)
        share = np.where(at - low < 1e-6, 0.0, at - low)[:, None, None]
        after = self.positions_mm[np.minimum(low + 1, self.n_frames - 1)]
        between = self.positions_mm[low] * (1 - share) + share * after
        positions = np.where(share == 0, self.positions_mm[low], between)
        return replace(self, positions_mm=positions, rate_hz=float(rate_hz))


def joined(parts: Sequence[Markers]) -> Markers:
    """Recordings of the same markers, one after the other."""
    labels = parts[0].labels
    positions = np.concatenate([part.select(labels).positions_mm for part in parts])
    return Markers(labels, positions, parts[0].rate_hz, parts[0].unit)
