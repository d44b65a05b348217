"""Which few markers to record: the ranking of the hand-over paper, and a greedy one.

**Algorithm 1.** PCA of the ``3 M`` coordinates of ``M`` markers in the root's frame gives
components ``c_k`` and eigenvalues ``lambda_k``. The influence of a marker is the sum over its x,
y and z and over the components of ``|c_k lambda_k|``; markers are recorded in falling order of
it. The unweighted variant sums ``|c_k|`` over the first ``N`` components only. Both give one
order, so the best six contain the best three.

The absolute values depend on which way x, y and z point. They are therefore taken along the
principal axes of the markers' pooled motion, so that the order does not depend on how the root's
frame happens to be turned.

**Greedy** (ours). The next marker is the one that most lowers the cross-validated error of the
reconstruction itself (:mod:`handtrack.mocap.validation`).

>>> rng = np.random.default_rng(0)
>>> moves = rng.normal(size=(50, 2, 3)) * [[[1.0], [30.0]]]
>>> rank(("still", "lively"), moves).order
('lively', 'still')
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.mocap import pca
from handtrack.mocap.settings import Handover
from handtrack.mocap.validation import held_out

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ranking:
    """Markers from the most to the least useful, and each one's share (they sum to one)."""

    method: str
    order: tuple[str, ...]
    share: tuple[float, ...]

    def top(self, n: int) -> tuple[str, ...]:
        """The first ``n``."""
        return self.order[:n]


def rank(labels: Sequence[str], positions_mm: ArrayLike, top_components: int = 0) -> Ranking:
    """Rank markers by their influence on the principal components of their motion.

    Parameters
    ----------
    labels : M names.
    positions_mm : (F, M, 3) in the root's frame; frames with a missing marker are left out.
    top_components : 0 for Algorithm 1; ``N`` for the unweighted sum over the first ``N``.

    Raises
    ------
    InputError
        Fewer than two frames show all markers.
    """
    X = np.asarray(positions_mm, float)
    X = X[np.isfinite(X).all(axis=(1, 2))]
    if len(X) < 2:
        raise InputError("ranking needs two frames or more in which every marker is seen")
    moves = X - X.mean(axis=0)
    _, axes = np.linalg.eigh(np.einsum("fma,fmb->ab", moves, moves))
    found = pca.fit((moves @ axes).reshape(len(X), -1))
    weight = found.variance if top_components == 0 else np.ones(len(found.variance))
    weight = weight[: top_components or None]
    influence = np.abs(found.components[: len(weight)] * weight[:, None]).sum(axis=0)
    influence = influence.reshape(-1, 3).sum(axis=1)
    order = np.argsort(-influence, kind="stable")
    share = influence / influence.sum()
    method = "algorithm 1" if top_components == 0 else f"unweighted, top {top_components}"
    return Ranking(method, tuple(labels[m] for m in order), tuple(float(share[m]) for m in order))


def greedy(
    labels: Sequence[str],
    positions_mm: ArrayLike,
    theta: ArrayLike,
    top: int,
    settings: Handover,
    folds: ArrayLike,
    frames: int = 1500,
    progress: Callable[[str], None] = lambda text: None,
) -> Ranking:
    """Rank markers by how much each lowers the cross-validated error of the reconstruction.

    Parameters
    ----------
    labels : M names.
    positions_mm : (F, M, 3) in the root's frame, nothing missing.
    theta : (F, 20) what is reconstructed, in radians.
    top : how many to rank.
    settings : the reconstruction to rank for; windows of frames are not looked at.
    folds : (N,) the group of each frame; groups are held out in turn.
    frames : at most so many frames are used, evenly spaced.
    progress : is told each marker as it is chosen.

    Returns
    -------
    Ranking
        Its shares are the fall of the error that each marker brought, from that of the mean pose.

    Raises
    ------
    InputError
        There is one group only: nothing to hold out.
    """
    X, Y = np.asarray(positions_mm, float), np.asarray(theta, float)
    rows = np.linspace(0, len(X) - 1, min(frames, len(X))).round().astype(int)
    X, Y, group = X[rows], Y[rows], np.asarray(folds)[rows]
    if len(np.unique(group)) < 2:
        raise InputError(f"a greedy ranking of {len(rows)} frames: too few to hold some out")
    errors = [float(np.abs(Y - Y.mean(axis=0)).mean())]
    chosen: list[int] = []
    while len(chosen) < min(top, len(labels)):
        rest = [m for m in range(len(labels)) if m not in chosen]
        trial = {m: held_out(settings, X[:, [*chosen, m]], Y, group).error(Y) for m in rest}
        best = min(trial, key=lambda m: trial[m])
        chosen.append(best)
        errors.append(trial[best])
        progress(f"{labels[best]} ({np.degrees(trial[best]):.2f} deg)")
    falls = np.maximum(-np.diff(errors), 0.0)
    share = falls / max(falls.sum(), 1e-12)
    return Ranking("greedy", tuple(labels[m] for m in chosen), tuple(map(float, share)))
