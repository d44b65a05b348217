"""Marker sets as data: which markers there are, where each sits, which carry the root.

>>> full = marker_set("full13")
>>> len(full.markers), full.root
(13, ('root_wrist', 'root_index', 'root_little'))
"""

from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from handtrack.errors import InputError
from handtrack.hand.skeleton import KEYPOINT_NAMES
from handtrack.toml_file import check_keys, read_document

_FORMAT, _VERSION = "handtrack-marker-sets", 1


@dataclass(frozen=True)
class Site:
    """Where a marker sits: on a bone, or (``bone`` empty) on the palm.

    Parameters
    ----------
    bone : the keypoint at which the bone begins.
    along : 0 at that keypoint, 1 at the next.
    dorsal_mm : height above the bone's axis.
    palm : place in the palm frame, in palm lengths.
    """

    bone: str = ""
    along: float = 0.0
    dorsal_mm: float = 0.0
    palm: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class MarkerSet:
    """A named set: the root markers and the others, and where each sits."""

    name: str
    about: str
    root: tuple[str, ...]
    markers: tuple[str, ...]
    sites: dict[str, Site]

    @property
    def labels(self) -> tuple[str, ...]:
        """All of them, the root's first."""
        return (*self.root, *self.markers)


def marker_set(name: str, path: str | Path | None = None) -> MarkerSet:
    """The set called ``name`` of the file at ``path``, by default the one in the package.

    Raises
    ------
    InputError
        There is no such set (the message lists them), or the file is not one of marker sets.
    """
    sets = _read(Path(path)) if path else _shipped()
    if name not in sets:
        raise InputError(f"no marker set '{name}'; there are {', '.join(sets)}")
    return sets[name]


@cache
def _shipped() -> dict[str, MarkerSet]:
    with resources.as_file(resources.files("handtrack.mocap").joinpath("data")) as folder:
        return _read(folder / "marker_sets.toml")


def _read(path: Path) -> dict[str, MarkerSet]:
    document = read_document(path, _FORMAT, _VERSION)
    check_keys(path, set(document), {"markers", "sets"}, set())
    sites = {name: _site(path, name, entry) for name, entry in document["markers"].items()}
    sets = {}
    for name, entry in document["sets"].items():
        check_keys(path, set(entry), {"root", "markers"}, {"about"})
        stray = [m for m in (*entry["root"], *entry["markers"]) if m not in sites]
        if stray:
            raise InputError(f"{path}: set '{name}' has {', '.join(stray)}, which has no place")
        members = (*entry["root"], *entry["markers"])
        sets[name] = MarkerSet(
            name,
            entry.get("about", ""),
            tuple(entry["root"]),
            tuple(entry["markers"]),
            {m: sites[m] for m in members},
        )
    return sets


def _site(path: Path, name: str, entry: dict[str, Any]) -> Site:
    if "palm" in entry:
        check_keys(path, set(entry), {"palm"}, set())
        x, y, z = (float(v) for v in entry["palm"])
        return Site(palm=(x, y, z))
    check_keys(path, set(entry), {"bone", "along", "dorsal_mm"}, set())
    bone = entry["bone"]
    if bone not in KEYPOINT_NAMES[1:] or bone.endswith("_tip"):
        raise InputError(f"{path}: marker '{name}' sits on '{bone}', where no bone begins")
    return Site(bone, float(entry["along"]), float(entry["dorsal_mm"]))
