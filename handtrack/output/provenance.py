"""``run.json``: what ran on what, with which settings, and what came of it.

>>> Counts(container=3, decoded=2, undecodable=1, tracked=2).complete
False
"""

import json
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.output.files import open_whole
from handtrack.records import Status
from handtrack.tables import FORMAT, RUN_JSON, read_provenance

__all__ = [
    "RUN_JSON",
    "Counts",
    "main_side",
    "medians_ms",
    "read_provenance",
    "versions",
    "write_provenance",
]

FORMAT_VERSION = 1

_PACKAGES = ("handtrack", "av", "numba", "numpy", "opencv-contrib-python-headless", "scipy")


@dataclass
class Counts:
    """How many frames there were, and of which status."""

    container: int | None = None  # what the container says, if it says
    decoded: int = 0
    undecodable: int = 0
    tracked: int = 0
    predicted: int = 0
    lost: int = 0

    def add(self, status: Status) -> None:
        """Count one frame."""
        setattr(self, status.value, getattr(self, status.value) + 1)
        self.decoded += status is not Status.UNDECODABLE

    @property
    def complete(self) -> bool:
        """Whether every frame that the container promises was decoded."""
        return not self.undecodable and self.decoded >= (self.container or 0)

    @property
    def sentence(self) -> str:
        """The counts for people."""
        said = "an unknown number" if self.container is None else str(self.container)
        return (
            f"container says {said}, decoded {self.decoded}, tracked {self.tracked} "
            f"(predicted {self.predicted}, lost {self.lost}, undecodable {self.undecodable})"
        )


def versions() -> dict[str, str]:
    """Versions of everything that bears on the numbers."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


def medians_ms(timings_ms: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Median of each stage that ran at all."""
    return {stage: round(float(np.median(ms)), 3) for stage, ms in timings_ms.items() if len(ms)}


def main_side(sides: Counter[str]) -> str:
    """The side that most frames have; empty if none has any."""
    known = {side: n for side, n in sides.items() if side}
    return max(sorted(known), key=lambda side: known[side]) if known else ""


def write_provenance(path: Path, record: Mapping[str, Any]) -> None:
    """Write ``run.json``, format and version first.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    document = {"format": FORMAT, "version": FORMAT_VERSION} | dict(record)
    with open_whole(path) as file:
        file.write(json.dumps(_plain(document), indent=2, ensure_ascii=False) + "\n")


def _plain(value: Any) -> Any:
    """The value as JSON has it; NaN becomes null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if isinstance(value, Enum):
        return value.value
    return str(value) if isinstance(value, Path | Fraction) else value
