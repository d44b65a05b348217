"""What the hand-over method reaches: errors by components, by marker set, with and without PCA.

A study is a data base and test clips that are not in it. Every error is the mean absolute
difference of the 20 angles, in degrees, over the frames whose truth can be trusted.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from handtrack.bench.channels import mean_knuckles, rotation_channels
from handtrack.mocap import pca
from handtrack.mocap.database import Clip, Database, build
from handtrack.mocap.handover import columns, in_root, reconstruct
from handtrack.mocap.markers import Markers
from handtrack.mocap.ranking import Ranking, greedy, rank
from handtrack.mocap.regression import Regression, predict
from handtrack.mocap.root import reference_of, root_relative
from handtrack.mocap.settings import Handover
from handtrack.mocap.smoothing import cone, lag_frames
from handtrack.mocap.validation import NINETY

Array = NDArray[np.float64]
#: Name, markers and settings of a row.
Set = tuple[str, tuple[str, ...], Handover]

#: By hand, after Hoyet et al. 2012: thumb, index and little finger, tip and middle joint.
MANUAL6 = ("thumb_tip", "index_tip", "little_tip", "thumb_ip", "index_pip", "little_pip")
TIPS5 = ("thumb_tip", "index_tip", "middle_tip", "ring_tip", "little_tip")
#: Poses that Kang et al. 2012 boil their data base down to.
CLUSTERS = 30
PAPER = Handover()
#: The same regression, whose weights fall off faster.
SHARP = Handover(Regression(power=3.0))
CLOSED = Handover(Regression(ridge_mm=0.5, power=3.0), close_mm=0.2)
#: The tuned rows: chosen once, for all sets and data bases. Choosing on each data base, by
#: cross-validation, does no better (docs/handover.md).
TUNED = replace(CLOSED, borrow=300, rounds=2)


@dataclass(frozen=True, eq=False)
class Study:
    """A data base, the clips it is tested on, and a name for the pair.

    ``borrows`` is false where the poses that ship are those of the tests.
    """

    name: str
    base: Database
    tests: tuple[Clip, ...]
    borrows: bool = True

    @property
    def settings(self) -> Handover:
        """Of the tuned rows."""
        return TUNED if self.borrows else replace(TUNED, borrow=0)


def study(name: str, train: Sequence[Clip], tests: Sequence[Clip], stride: int = 1) -> Study:
    """Put a study together, every ``stride``-th frame of each clip."""
    kept = [thinned(clip, stride) for clip in train]
    return Study(name, build(kept), tuple(thinned(clip, stride) for clip in tests))


def thinned(clip: Clip, stride: int) -> Clip:
    """Every ``stride``-th frame of a clip."""
    markers = replace(
        clip.markers,
        positions_mm=clip.markers.positions_mm[::stride],
        rate_hz=clip.markers.rate_hz / stride,
    )
    palm = replace(clip.palm, R=clip.palm.R[::stride], t_mm=clip.palm.t_mm[::stride])
    return replace(
        clip, markers=markers, theta=clip.theta[::stride], ok=clip.ok[::stride], palm=palm
    )


@dataclass(frozen=True)
class Score:
    """Of one clip: mean absolute error of the angles and of the channels of a skeleton
    (:mod:`handtrack.bench.channels`), 95th percentile, lag, share inside the 90 % interval."""

    error_deg: float
    channels_deg: float
    p95_deg: float
    lag_frames: int
    inside_90: float


def score(s: Study, clip: Clip, chosen: Sequence[str], settings: Handover = PAPER) -> Score:
    """How well the angles of a clip come out of the ``chosen`` markers."""
    X = columns(s.base, clip.markers.labels, chosen)
    Q, _ = in_root(s.base, clip.markers, chosen)
    got = reconstruct(s.base, X, Q, settings)
    off = np.abs(got.theta - clip.theta)[clip.ok]
    inside = off <= NINETY * got.std[clip.ok]
    about = mean_knuckles(s.base.theta)
    turned = rotation_channels(got.theta, about) - rotation_channels(clip.theta, about)
    return Score(
        error_deg=float(np.degrees(off.mean())),
        channels_deg=float(np.degrees(np.abs(turned)[clip.ok].mean())),
        p95_deg=float(np.degrees(np.percentile(off, 95))),
        lag_frames=lag_frames(got.theta, clip.theta),
        inside_90=float(inside.mean()),
    )


def errors(s: Study, chosen: Sequence[str], settings: Handover = PAPER) -> list[float]:
    """The error of every test clip, in degrees."""
    return [score(s, clip, chosen, settings).error_deg for clip in s.tests]


def by_components(s: Study, chosen: Sequence[str]) -> dict[int, list[float]]:
    """Figure 1: the error of every test clip against the number of components."""
    space = pca.fit(s.base.theta)
    found: dict[int, list[float]] = {K: [] for K in range(1, len(space.variance) + 1)}
    for clip in s.tests:
        X, Q = _query(s, clip, chosen)
        scores = reconstruct(s.base, X, Q, PAPER).scores  # each component is its own regression
        for K, row in found.items():
            off = np.abs(space.back(scores[:, :K]) - clip.theta)[clip.ok]
            row.append(float(np.degrees(off.mean())))
    return found


def cluster_pose_six(base: Database, rng: np.random.Generator, size: int = 6) -> tuple[str, ...]:
    """The set by which the nearest of a few cluster poses tells the hand best (Kang 2012)."""
    rows = np.linspace(0, len(base.theta) - 1, 800).round().astype(int)
    _, label = kmeans2(base.theta, CLUSTERS, minit="++", rng=rng)
    found = [label == c for c in range(CLUSTERS) if (label == c).any()]
    poses = np.array([base.theta[mask].mean(axis=0) for mask in found])
    places = np.array([base.X_mm[mask].mean(axis=0) for mask in found])
    apart = ((base.X_mm[rows, None] - places) ** 2).sum(axis=-1)  # (F, C, M)
    wrong = np.abs(base.theta[rows, None] - poses).mean(axis=-1)  # (F, C)
    sets = list(combinations(range(len(base.labels)), size))
    worth = []
    for first in range(0, len(sets), 100):
        mask = np.zeros((len(base.labels), len(sets[first : first + 100])))
        for column, members in enumerate(sets[first : first + 100]):
            mask[list(members), column] = 1
        nearest = (apart @ mask).argmin(axis=1)  # (F, sets)
        worth += np.take_along_axis(wrong, nearest, axis=1).mean(axis=0).tolist()
    return tuple(base.labels[m] for m in sets[int(np.argmin(worth))])


def marker_sets(s: Study, rng: np.random.Generator | None = None) -> Iterator[Set]:
    """Figure 4 and beyond: name, markers and settings of every row.

    Without ``rng`` (of the clusters), only of those that are shown over all splits.
    """
    base = s.base
    ranking = rank(base.labels, base.X_mm)
    yield "all 13", base.labels, PAPER
    yield "ranked 6 (Algorithm 1)", ranking.top(6), PAPER
    yield "ranked 3 (Algorithm 1)", ranking.top(3), PAPER
    yield "ranked 6, power 3", ranking.top(6), SHARP
    yield "ranked 3, power 3", ranking.top(3), SHARP
    if rng is not None:
        plain = rank(base.labels, base.X_mm, top_components=3)
        yield "unweighted 6 (top 3 components)", plain.top(6), PAPER
    yield "manual 6 (Hoyet)", MANUAL6, PAPER
    if rng is not None:
        yield "cluster-pose 6 (Kang)", cluster_pose_six(base, rng), PAPER
        yield "five fingertips", TIPS5, PAPER
    steps = greedy_for(base, PAPER)
    yield "greedy 6", steps.top(6), PAPER
    yield "greedy 3", steps.top(3), PAPER
    yield "all 13, tuned", base.labels, s.settings
    yield "ranked 6, tuned", ranking.top(6), s.settings
    yield "ranked 3, tuned", ranking.top(3), s.settings
    if rng is not None:
        yield "manual 6, tuned", MANUAL6, s.settings
    steps = greedy_for(base, s.settings)
    yield "greedy 6, tuned", steps.top(6), s.settings
    yield "greedy 3, tuned", steps.top(3), s.settings


def greedy_for(base: Database, settings: Handover, frames: int = 400) -> Ranking:
    """The six markers that a greedy ranking picks for these settings, with one round of them."""
    settings = replace(settings, rounds=1)
    return greedy(base.labels, base.X_mm, base.theta, 6, settings, base.folds(), frames)


def with_and_without_pca(s: Study, chosen: Sequence[str]) -> dict[str, list[float]]:
    """Figure 2, taken apart: what does going through the components change?"""
    half_turn = np.radians(170.0)
    K95 = int(np.searchsorted(np.cumsum(v := pca.fit(s.base.theta).variance) / v.sum(), 0.95)) + 1
    rows: dict[str, Callable[[Clip], Array]] = {
        "straight to angles": lambda c: _straight(s, c, chosen),
        "through all components": lambda c: _through(s, c, chosen, 0, 1),
        "through all components, smoothed": lambda c: _through(s, c, chosen, 0, PAPER.taps),
        "straight to angles, smoothed": lambda c: _straight(s, c, chosen, taps=PAPER.taps),
        f"through {K95} components (95 %)": lambda c: _through(s, c, chosen, K95, 1),
        "straight to Euler channels that wrap": lambda c: _straight(s, c, chosen, half_turn),
        f"through {K95} components of those": lambda c: _wrapped_pca(s, c, chosen, half_turn, K95),
    }
    return {
        name: [float(np.degrees(np.abs(f(c) - c.theta)[c.ok].mean())) for c in s.tests]
        for name, f in rows.items()
    }


def _query(s: Study, clip: Clip, chosen: Sequence[str]) -> tuple[Array, Array]:
    return columns(s.base, clip.markers.labels, chosen), in_root(s.base, clip.markers, chosen)[0]


def _through(s: Study, clip: Clip, chosen: Sequence[str], K: int, taps: int) -> Array:
    X, Q = _query(s, clip, chosen)
    return reconstruct(s.base, X, Q, replace(PAPER, components=K, taps=taps)).theta


def _straight(
    s: Study, clip: Clip, chosen: Sequence[str], offset: float = 0.0, taps: int = 1
) -> Array:
    """Regression to the angles; with an ``offset``, to channels that hold them wrapped."""
    X, Q = _query(s, clip, chosen)
    got = predict(PAPER.regression, X, _wrap(s.base.theta + offset), Q).mean
    return _wrap(cone(got, s.base.rate_hz, taps) - offset)


def _wrapped_pca(s: Study, clip: Clip, chosen: Sequence[str], offset: float, K: int) -> Array:
    X, Q = _query(s, clip, chosen)
    space = pca.fit(_wrap(s.base.theta + offset))
    scores = space.scores(_wrap(s.base.theta + offset))[:, :K]
    return _wrap(space.back(predict(PAPER.regression, X, scores, Q).mean) - offset)


def _wrap(angles: Array) -> Array:
    """Angles in ``(-pi, pi]``."""
    return np.asarray((angles + np.pi) % (2 * np.pi) - np.pi)


def leave_one_out_mm(
    markers: Markers, root: Sequence[str], hand: Sequence[str], train_share: float = 2 / 3
) -> Mapping[str, float]:
    """Each real marker from the others: median distance in mm on the last third of a recording."""
    chosen = markers.select((*root, *hand))
    local = root_relative(chosen, root, reference_of(markers.select(root).positions_mm))
    whole = local.positions_mm[local.seen.all(axis=1)]
    split = int(train_share * len(whole))
    found = {}
    for m, label in enumerate(local.labels):
        rest = [k for k in range(len(local.labels)) if k != m]
        got = predict(
            PAPER.regression, whole[:split][:, rest], whole[:split, m], whole[split:][:, rest]
        )
        found[label] = float(np.median(np.linalg.norm(got.mean - whole[split:, m], axis=-1)))
    return found
