"""Fits a configuration space to recordings, and says how much of other motion it keeps.

The fit is a principal component analysis by singular values, on the sample of
:mod:`handtrack.hand.sample`, with the basis states of :mod:`handtrack.hand.basis`; the same seed
gives the same space. Of angles ``theta`` ``(n, 20)`` a space keeps, with ``P`` the projection::

    kept = 1 - sum |theta - P(theta)|^2 / sum |theta - mean(theta)|^2

so a wrong mean counts against it, and ``rms = sqrt(mean (theta - P(theta))^2)`` over all angles.

>>> from handtrack.hand.space import default
>>> kept_by(default(), default().basis_theta)[1] < 4  # deg
True
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.basis import choose_basis, curls, pattern_support
from handtrack.hand.sample import draw_sample, thin
from handtrack.hand.skeleton import DIGITS
from handtrack.hand.space import ALL_PATTERNS, ConfigurationSpace, principal, state_name

Array = NDArray[np.float64]

DIMS, KEEP, SAMPLES, SEED = 7, 28, 36_000, 2002


@dataclass(frozen=True, eq=False)
class RecordedSet:
    """All frames of one set that can be trusted, and where they come from."""

    source: str
    licence: str
    theta: Array  # (n, 20) radians


def fit_space(
    sets: list[RecordedSet],
    dims: int = DIMS,
    keep: int = KEEP,
    samples: int = SAMPLES,
    seed: int = SEED,
) -> ConfigurationSpace:
    """Fit a space of ``dims`` dimensions with ``keep`` basis states to ``samples`` angles.

    Raises
    ------
    InputError
        There are no recordings, or a number is out of range.
    """
    if samples < 1000:
        raise InputError(f"{samples} samples are too few for 20 angles: take 1000 or more")
    thinned = [thin(recorded.theta) for recorded in sets]
    basis = choose_basis(thinned, keep)
    theta, drawn = draw_sample(thinned, basis, samples, np.random.default_rng(seed))
    covariance = np.cov(theta.T)
    spectrum, directions = principal(covariance)
    space = ConfigurationSpace(
        mean=theta.mean(axis=0),
        components=directions,
        spectrum=spectrum,
        covariance=covariance,
        extended=basis.extended,
        curled=basis.curled,
        basis_curled=basis.states,
        support=basis.support,
        falling=basis.falling,
        provenance={
            "sources": [
                {
                    "source": recorded.source,
                    "licence": recorded.licence,
                    "frames": len(recorded.theta),
                    "frames_apart": len(few),
                }
                for recorded, few in zip(sets, thinned, strict=True)
            ],
            "sample": drawn,
            "seed": seed,
            "keep": keep,
            "dims": dims,
        },
    )
    return space.with_dims(dims)


def kept_by(space: ConfigurationSpace, theta: Array) -> tuple[float, float]:
    """Share of the variance of ``theta`` ``(n, 20)`` that a space keeps, and rms error in deg."""
    lost = theta - space.to_angles(space.to_X(theta), clip=False)
    total = ((theta - theta.mean(axis=0)) ** 2).sum()
    return float(1 - (lost**2).sum() / total), float(np.degrees(np.sqrt((lost**2).mean())))


def table(space: ConfigurationSpace, tests: dict[str, Array], dims: range) -> str:
    """Variance kept and rms error for each set of angles ``(n, 20)`` and number of dimensions.

    The first row is the sample that the space was fitted to, from its spectrum.
    """
    rows = [["dimensions", *map(str, dims)]]
    total = space.spectrum.sum()
    cells = []
    for k in dims:
        lost = space.spectrum[k:].sum()
        cells.append((1 - lost / total, np.degrees(np.sqrt(lost / len(space.spectrum)))))
    rows.append(["sample (fitted)", *map(_cell, cells)])
    for name, theta in tests.items():
        rows.append([name, *(_cell(kept_by(space.with_dims(k), theta)) for k in dims)])
    return _markdown(rows)


def states_table(space: ConfigurationSpace, others: dict[str, Array]) -> str:
    """The patterns that are no basis states, with their support in the recordings fitted to.

    ``others`` are angles ``(n, 20)`` of other recordings, whose support gets a column each.
    """
    rows = [["left out", "curled", "recorded frames", *(f"in {name}" for name in others)]]
    index = {state_name(p): i for i, p in enumerate(ALL_PATTERNS)}
    theirs = [
        pattern_support(curls(theta, space.extended, space.curled))[0] for theta in others.values()
    ]
    for name, support in space.dropped:
        curled = ", ".join(d for d, letter in zip(DIGITS, name, strict=True) if letter != "-")
        shares = [support, *(other[index[name]] for other in theirs)]
        rows.append([name, curled, *(f"{100 * share:.2f} %" for share in shares)])
    return _markdown(rows)


def _cell(kept: tuple[float, float]) -> str:
    return f"{100 * kept[0]:.1f} % ({kept[1]:.1f})"


def _markdown(rows: list[list[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |"
        for row in rows
    ]
    rule = "|" + "|".join("-" * (w + 2) for w in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])
