"""The page of ``handtrack bench handover``: tables and plots of what was measured."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handtrack.bench.handover_splits import Row
from handtrack.bench.handover_study import PAPER, Study, greedy_for
from handtrack.mocap import page
from handtrack.mocap.handover import columns, in_root, reconstruct
from handtrack.mocap.marker_sets import marker_set
from handtrack.mocap.pca import fit
from handtrack.mocap.ranking import rank


def study_parts(s: Study, measured: Mapping[str, Any]) -> list[str]:
    """Tables and plots of one study, Figures 1, 2, 4 and 5."""
    from matplotlib.figure import Figure

    rows = [
        {"markers": r["set"]}
        | {c: f"{e:.2f}" for c, e in zip(measured["tests"], r["error_deg"], strict=True)}
        | {"mean": f"{r['mean_deg']:.2f}", "by channels": f"{r['channels_deg']:.2f}"}
        | {"in 90 %": f"{np.mean(r['inside_90']):.2f}"}
        for r in measured["figure4"]
    ]
    pca = [
        {"markers": n, "regression": name}
        | {c: f"{e:.2f}" for c, e in zip(measured["tests"], v, strict=True)}
        for n, found in measured["figure2"].items()
        for name, v in found.items()
    ]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    curve = np.array(list(measured["figure1"].values()))
    for k, name in enumerate(measured["tests"]):
        left.plot(list(measured["figure1"]), curve[:, k], "o-", ms=3, label=name)
    left.set(xlabel="components", ylabel="mean error, deg", title="six markers (Figure 1)")
    left.set_ylim(bottom=0)
    left.legend(fontsize=8)
    names = [r["set"] for r in measured["figure4"]]
    right.barh(names, [r["mean_deg"] for r in measured["figure4"]], color="#0072b2")
    right.invert_yaxis()
    right.tick_params(axis="y", labelsize=7)
    right.set(xlabel="mean error, deg", title="marker sets (Figure 4)")
    return [
        f"<h2>{s.name}</h2>",
        page.table(rows),
        page.picture(figure, "error by components and by marker set"),
        page.picture(_over_time(s), "components over time (Figure 5)"),
        page.picture(
            page.draw_ranking(rank(s.base.labels, s.base.X_mm), marker_set("full13")), "ranking"
        ),
        "<h3>With and without the components (Figure 2)</h3>",
        page.table(pca),
    ]


def _over_time(s: Study) -> Any:
    """Figure 5: components over time, six and three markers against the truth."""
    ranking, clip = rank(s.base.labels, s.base.X_mm), s.tests[0]
    curves = {"truth": fit(s.base.theta).scores(clip.theta)}
    for n in (6, 3):
        X = columns(s.base, clip.markers.labels, ranking.top(n))
        Q, _ = in_root(s.base, clip.markers, ranking.top(n))
        curves[f"{n} markers"] = reconstruct(s.base, X, Q, PAPER).scores
    best = greedy_for(s.base, s.settings).top(6)
    X, (Q, _) = columns(s.base, clip.markers.labels, best), in_root(s.base, clip.markers, best)
    curves["6 greedy, closed"] = fit(s.base.theta).scores(
        reconstruct(s.base, X, Q, s.settings).theta
    )
    return page.draw_components(np.arange(len(clip.theta)) / s.base.rate_hz, curves)


def split_parts(side: str, rows: Mapping[str, Row]) -> list[str]:
    """The table over all splits of the ManipNet clips."""
    table = [
        {"markers": name}
        | {"mean": f"{row.mean_deg:.2f}", "by channels": f"{row.channels_deg:.2f}"}
        | {"median split": f"{row.median_deg:.2f}"}
        | {"best": f"{row.best_deg:.2f}", "worst": f"{row.worst_deg:.2f}"}
        | {clip: f"{error:.2f}" for clip, error in row.by_clip_deg.items()}
        | {"in 90 %": f"{row.inside_90:.2f}"}
        for name, row in rows.items()
    ]
    return [f"<h2>ManipNet {side}, every two clips of six held out</h2>", page.table(table)]
