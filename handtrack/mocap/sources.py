"""A ranking of whatever a user has: BVH files, marker files, or sequences that ship.

>>> from handtrack.mocap.marker_sets import marker_set
>>> rank_sources(["girl"], marker_set("full13")).top(1)
('thumb_tip',)
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from handtrack.errors import InputError
from handtrack.mocap.database import read_database, root_labels
from handtrack.mocap.marker_io import SUFFIXES, read_markers
from handtrack.mocap.marker_sets import MarkerSet
from handtrack.mocap.markers import Markers, joined
from handtrack.mocap.ranking import Ranking, greedy, rank
from handtrack.mocap.root import reference_of, root_relative
from handtrack.mocap.settings import Handover

Method = Literal["algorithm1", "unweighted", "greedy"]


def rank_sources(
    sources: Sequence[str],
    chosen: MarkerSet,
    method: Method = "algorithm1",
    components: int = 3,
    top: int = 6,
    mapping: str = "auto",
    root: Sequence[str] = (),
    settings: Handover | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Ranking:
    """Rank the markers of BVH files, of marker files, or of sequences that ship.

    ``components`` is for the unweighted method, ``top`` and ``settings`` (the paper's where none
    are given) for the greedy one, which tells ``progress`` of every marker that it chose.

    Raises
    ------
    InputError
        A source cannot be read; or marker files are mixed with others or ranked greedily.
    """
    files = [Path(source).suffix.lower() in SUFFIXES for source in sources]
    count = components if method == "unweighted" else 0
    if any(files):
        if method == "greedy" or not all(files):
            raise InputError(
                "marker files hold no angles: give BVH files alone, or rank marker files "
                "alone by algorithm1 or unweighted"
            )
        return _rank_markers([read_markers(source) for source in sources], count, root)
    base = read_database(sources, chosen, mapping, root or None)
    if method != "greedy":
        return rank(base.labels, base.X_mm, count)
    return greedy(
        base.labels,
        base.X_mm,
        base.theta,
        top,
        settings or Handover(),
        base.folds(),
        progress=progress,
    )


def _rank_markers(parts: Sequence[Markers], count: int, root: Sequence[str]) -> Ranking:
    markers = joined([part.select(parts[0].labels) for part in parts])
    names = root or root_labels(markers.labels)
    reference = reference_of(markers.select(names).positions_mm)
    local = root_relative(markers, names, reference)
    return rank(local.labels, local.positions_mm, count)
