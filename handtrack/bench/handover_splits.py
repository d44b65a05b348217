"""Every way to hold out two of a few clips: no split is chosen for its number.

With six clips there are 15 splits into four that are learnt from and two that are tested, and each
clip is tested five times. The mean over all of them is the headline, with the median over the
splits and each clip's own mean beside it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from handtrack.bench.handover_study import (
    Score,
    Set,
    Study,
    marker_sets,
    score,
    study,
)
from handtrack.mocap.database import Clip

HELD_OUT = 2


@dataclass(frozen=True)
class Row:
    """A set of markers over all splits, in degrees; ``inside_90`` is a share.

    ``channels_deg`` is the mean as a skeleton counts it (:mod:`handtrack.bench.channels`).
    """

    mean_deg: float
    channels_deg: float
    median_deg: float
    best_deg: float
    worst_deg: float
    by_clip_deg: Mapping[str, float]
    inside_90: float


def over_splits(
    clips: Mapping[str, Clip],
    stride: int,
    progress: Callable[[str], object] = lambda text: None,
    sets: Callable[[Study], Iterable[Set]] = marker_sets,
) -> dict[str, Row]:
    """Rows by name, each over every choice of two clips to hold out.

    ``sets`` gives the rows of a split, by default those of the study that need no ``rng``.
    """
    scores: dict[str, list[list[Score]]] = {}
    splits = list(combinations(sorted(clips), HELD_OUT))
    for tests in splits:
        learnt = [clips[name] for name in sorted(clips) if name not in tests]
        s = study(", ".join(tests), learnt, [clips[name] for name in tests], stride)
        for name, chosen, settings in sets(s):
            found = [score(s, clip, chosen, settings) for clip in s.tests]
            scores.setdefault(name, []).append(found)
        progress(s.name)
    return {name: _row(splits, found) for name, found in scores.items()}


def _row(splits: Sequence[tuple[str, ...]], scores: Sequence[Sequence[Score]]) -> Row:
    every = [one for found in scores for one in found]
    table = np.array([[one.error_deg for one in found] for found in scores])  # (splits, 2)
    clips = sorted({name for tests in splits for name in tests})
    flat = list(zip(np.ravel(splits).tolist(), table.ravel().tolist(), strict=True))
    means = table.mean(axis=1)
    return Row(
        mean_deg=round(float(table.mean()), 3),
        channels_deg=round(float(np.mean([one.channels_deg for one in every])), 3),
        median_deg=round(float(np.median(means)), 3),
        best_deg=round(float(means.min()), 3),
        worst_deg=round(float(means.max()), 3),
        by_clip_deg={c: round(float(np.mean([e for n, e in flat if n == c])), 3) for c in clips},
        inside_90=round(float(np.mean([one.inside_90 for one in every])), 3),
    )
