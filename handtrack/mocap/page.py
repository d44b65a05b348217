"""Figures and a self-contained page for the marker commands.

>>> "<h1>A &amp; B</h1>" in page("A & B", ["text"])
True
"""

import base64
import html
import io
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import ANGLE_NAMES, DIGITS, KEYPOINT_NAMES
from handtrack.mocap.marker_sets import MarkerSet
from handtrack.mocap.ranking import Ranking

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_CURVES = ("k-", "C1-", "C0--", "C2:")
_STYLE = """body{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .8em;border-bottom:1px solid #ddd;
text-align:right}td:first-child,th:first-child{text-align:left}img{max-width:100%}"""


def page(title: str, parts: Sequence[str]) -> str:
    """A page of HTML parts, nothing outside it needed."""
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{_STYLE}</style>'
    body = "\n".join([f"<h1>{html.escape(title)}</h1>", *parts])
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>\n'


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """A table whose columns are the keys of the first row."""
    if not rows:
        return ""
    title = "".join(f"<th>{html.escape(str(key))}</th>" for key in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(v))}</td>" for v in row.values()) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{title}</tr>{body}</table>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def png(figure: "Figure") -> bytes:
    """The picture of a figure; the same figure gives the same bytes."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=100, metadata={"Software": None})
    return out.getvalue()


def picture(figure: "Figure", alt: str) -> str:
    """A figure inside the page."""
    data = base64.b64encode(png(figure)).decode()
    return f'<img alt="{html.escape(alt)}" src="data:image/png;base64,{data}">'


def draw_ranking(ranking: Ranking, chosen: MarkerSet, used: Sequence[str] = ()) -> "Figure":
    """The markers on the back of an open hand, discs as large as their share, with their rank."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 6.5), layout="constrained")
    axes = figure.subplots()
    shape = HandShape.default()
    theta = np.radians([{"index": 8, "ring": -6, "little": -12}.get(n, 0.0) for n in _spread()])
    points = keypoints_mm(theta, shape)[:, :2] * [-1, 1]  # seen from the back
    outline = shape.palm_outline_mm * [-1, 1]
    axes.fill(*outline.T, color="#eadfd4", zorder=0)
    for digit in range(len(DIGITS)):
        chain = points[1 + 4 * digit : 5 + 4 * digit]
        axes.plot(*chain.T, color="#eadfd4", lw=22, solid_capstyle="round", zorder=1)
        axes.plot(*chain.T, color="#b7a796", lw=1.5, zorder=2)
    for rank, (label, share) in enumerate(zip(ranking.order, ranking.share, strict=True), start=1):
        site = chosen.sites.get(label)
        if site is None or not site.bone:
            continue
        k = KEYPOINT_NAMES.index(site.bone)
        x, y = points[k] + site.along * (points[k + 1] - points[k])
        colour = "#d55e00" if label in used or (not used and rank <= 6) else "#9aa7b0"
        axes.scatter(x, y, s=120 + 2500 * share, color=colour, zorder=3, edgecolor="white")
        axes.text(x, y, str(rank), ha="center", va="center", fontsize=8, color="white", zorder=4)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(f"markers by {ranking.method}: rank, and area by share", fontsize=10)
    return figure


def draw_components(time_s: Array, curves: Mapping[str, Array], n: int = 4) -> "Figure":
    """The first ``n`` components over time; ``curves`` name the ``(F, K)`` that are drawn."""
    from matplotlib.figure import Figure

    n = min(n, *(curve.shape[1] for curve in curves.values()))
    figure = Figure(figsize=(9.0, 1.6 * n + 0.6), layout="constrained")
    for k, axes in enumerate(np.atleast_1d(figure.subplots(n, 1, sharex=True))):
        for (name, curve), style in zip(curves.items(), cycle(_CURVES), strict=False):
            axes.plot(time_s, np.degrees(curve[:, k]), style, lw=1.1, label=name)
        axes.set_ylabel(f"component {k + 1}\ndeg", fontsize=8)
        if k == 0:
            axes.legend(fontsize=8, ncols=len(curves))
    axes.set_xlabel("time, s")
    return figure


def draw_angles(time_s: Array, theta: Array, std: Array) -> "Figure":
    """The angles of each digit over time, with a band of one standard deviation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 9.0), layout="constrained")
    for d, axes in enumerate(figure.subplots(len(DIGITS), 1, sharex=True)):
        for k in range(4 * d, 4 * d + 4):
            mean, width = np.degrees(theta[:, k]), np.degrees(std[:, k])
            name = ANGLE_NAMES[k].partition("_")[2].replace("_", " ")
            (line,) = axes.plot(time_s, mean, lw=1.1, label=name)
            axes.fill_between(
                time_s, mean - width, mean + width, alpha=0.15, color=line.get_color()
            )
        axes.set_ylabel(f"{DIGITS[d]}, deg", fontsize=8)
        axes.legend(fontsize=7, ncols=4, loc="upper right")
    axes.set_xlabel("time, s")
    return figure


def _spread() -> list[str]:
    """The digit of each angle that is an abduction, else nothing."""
    return [n.partition("_")[0] if n.endswith("mcp_abduction") else "" for n in ANGLE_NAMES]
