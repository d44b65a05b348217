"""The benchmark's figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.bench.comparison import SCHEMES, Outcome
from handtrack.bench.speed import Timing
from handtrack.errors import OutputError
from handtrack.paper import PUBLISHED

_COLOUR = {"random": "#999999", "condensation": "#0072b2", "paper": "#d55e00", "refined": "#009e73"}
_LABEL = {
    "random": "random search",
    "condensation": "CONDENSATION",
    "paper": "along the lines (paper)",
    "refined": "refined (default)",
}


def plot_comparison(outcomes: Sequence[Outcome], path: Path) -> None:
    """Error against samples, and error against time; median of the seeds, their range shaded.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    by_samples, by_time = figure.subplots(1, 2, sharey=True)
    for name in SCHEMES:
        rows = by_count([o for o in outcomes if o.scheme == name])
        counts = list(rows)
        low, middle, high = (
            [f([o.bend_deg for o in rows[n]]) for n in counts] for f in (min, np.median, max)
        )
        ms = [float(np.median([o.ms for o in rows[n]])) for n in counts]
        for axes, x in ((by_samples, counts), (by_time, ms)):
            axes.plot(x, middle, "o-", ms=3, color=_COLOUR[name], label=_LABEL[name])
            axes.fill_between(x, low, high, color=_COLOUR[name], alpha=0.2, lw=0)
        if PUBLISHED[name] in counts:
            at = counts.index(PUBLISHED[name])
            by_samples.plot(counts[at], middle[at], "*", ms=13, color=_COLOUR[name])
    _refined(by_samples, by_time, [o for o in outcomes if o.scheme == "refined"])
    by_samples.set(xscale="log", xlabel="samples a frame", ylabel="error of bend angles, degrees")
    by_time.set(xscale="log", xlabel="processor time, ms a frame")
    by_samples.set_ylim(bottom=0)
    by_samples.legend(fontsize=8)
    by_samples.set_title("stars: as many as published", fontsize=9)
    _save(figure, path)


def plot_speed(timings: Sequence[Timing], path: Path) -> None:
    """Time against hypotheses, and against the side of the window.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    by_batch, by_side = figure.subplots(1, 2)
    for what in dict.fromkeys(t.what for t in timings):
        rows = [t for t in timings if t.what == what]
        axes = by_batch if what.startswith("likelihood") else by_side
        axes.loglog([t.size for t in rows], [t.ms for t in rows], "o-", ms=3, label=what)
    by_batch.set(xlabel="hypotheses", ylabel="ms")
    by_side.set(xlabel="side of the window, pixels", ylabel="ms")
    for axes in (by_batch, by_side):
        axes.legend(fontsize=8)
    _save(figure, path)


def by_count(outcomes: Sequence[Outcome]) -> dict[int, list[Outcome]]:
    """Outcomes grouped by their number of samples, rising."""
    counts = sorted({o.samples for o in outcomes})
    return {n: [o for o in outcomes if o.samples == n] for n in counts}


def _refined(by_samples: Any, by_time: Any, outcomes: Sequence[Outcome]) -> None:
    if not outcomes:
        return
    error = float(np.median([o.bend_deg for o in outcomes]))
    ms = float(np.median([o.ms for o in outcomes]))
    by_samples.axhline(error, color=_COLOUR["refined"], ls="--", label=_LABEL["refined"])
    by_time.plot(ms, error, "D", color=_COLOUR["refined"])


def _save(figure: Any, path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
