"""The benchmark's tables, as text: a row for each condition and method.

>>> rows = [{"condition": "clean", "method": "refined", "particles": None, "seeds": 1,
...          "scores": {"bend_deg": {"median": 5.0, "low": 5.0, "high": 5.0}}}]
>>> print(as_text(rows, {"bend_deg": "bend"}))
condition  method   bend
clean      refined  5.00
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from handtrack.bench.comparison import Outcome
from handtrack.bench.metrics import PAPER_ROWS, Scores

#: Scores of the main table and their headings.
MAIN: dict[str, str] = {
    "bend_deg": "bend deg",
    "bend_mcp_deg": "MCP",
    "bend_pip_deg": "PIP",
    "bend_dip_deg": "DIP",
    "bend_thumb_deg": "thumb",
    "bend_free_deg": "bend free",
    "palm_deg": "palm deg",
    "palm_free_deg": "palm free",
    "keypoints_px": "px",
    "jitter_deg": "jitter",
    "jitter_truth_deg": "(truth)",
    "tracked_share": "tracked",
    "found_share": "found",
    "frames_to_find": "to find",
    "lag_frames": "lag",
    "coverage_90": "cover 90",
    "track_ms": "ms/frame",
    "fps": "fps",
}
#: Scores of the paper's own table; it does not say about which axes its rotation is.
PAPER: dict[str, str] = {
    "x_px": "x px",
    "rotation_deg": "rotation",
    "palm_in_image_deg": "(in the image)",
    "index_pip_deg": "index PIP",
    "middle_mcp_deg": "middle MCP",
    "ring_pip_deg": "ring PIP",
    "ring_abduction_deg": "ring abd.",
}
#: What the paper says of them, a cell for each; empty where it says nothing.
PUBLISHED = [f"{PAPER_ROWS[name]:.2f}" if name in PAPER_ROWS else "" for name in PAPER]


def as_text(summary: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> str:
    """Medians in aligned columns, with ``+-`` half the range where there are several seeds."""
    head = ["condition", "method", *columns.values()]
    body = [
        [row["condition"], method_of(row), *(_cell(row["scores"].get(name)) for name in columns)]
        for row in summary
    ]
    return aligned([head, *body])


def paper_table(summary: Sequence[Mapping[str, Any]]) -> str:
    """The six numbers of the paper's simulation, theirs first."""
    head = ["condition", "method", *PAPER.values()]
    body = [
        [row["condition"], method_of(row), *(_cell(row["scores"].get(name)) for name in PAPER)]
        for row in summary
    ]
    return aligned([head, ["(published)", "paper", *PUBLISHED], *body])


def samples_table(outcomes: Sequence[Outcome]) -> str:
    """Schemes by number of samples: bend error, its range over the seeds, and time."""
    groups: dict[tuple[str, int], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        groups[outcome.scheme, outcome.samples].append(outcome)
    rows = [["scheme", "samples", "bend deg", "low", "high", "PIP deg", "ms/frame"]]
    for (scheme, samples), group in groups.items():
        bend = [o.bend_deg for o in group]
        numbers = [median(bend), min(bend), max(bend)]
        numbers += [median(o.pip_deg for o in group), median(o.ms for o in group)]
        rows.append([scheme, str(samples or "-"), *(f"{x:.2f}" for x in numbers)])
    return aligned(rows)


def ablation_table(outcomes: Sequence[tuple[str, Outcome]]) -> str:
    """Variants: bend error, its range over the seeds, PIP error and time."""
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for name, outcome in outcomes:
        groups[name].append(outcome)
    rows = [["variant", "samples", "bend deg", "low", "high", "PIP deg", "ms/frame"]]
    for name, group in groups.items():
        bend = [o.bend_deg for o in group]
        numbers = [median(bend), min(bend), max(bend)]
        numbers += [median(o.pip_deg for o in group), median(o.ms for o in group)]
        rows.append([name, str(group[0].samples), *(f"{x:.2f}" for x in numbers)])
    return aligned(rows)


def tracker_ablation_table(scores: Sequence[tuple[str, Scores]]) -> str:
    """Whole trackers: medians over the clips, and the range of the bend."""
    groups: dict[str, list[Scores]] = defaultdict(list)
    for name, found in scores:
        groups[name].append(found)
    columns = {"palm_deg": "palm deg", "keypoints_px": "px", "jitter_deg": "jitter"}
    columns |= {"tracked_share": "tracked"}
    rows = [["whole tracker", "clips", "bend deg", "low", "high", *columns.values()]]
    for name, group in groups.items():
        bend = [s["bend_deg"] for s in group]
        numbers = [median(bend), min(bend), max(bend)]
        numbers += [median(s[column] for s in group) for column in columns]
        rows.append([name, str(len(group)), *(f"{x:.2f}" for x in numbers)])
    return aligned(rows)


def method_of(row: Mapping[str, Any]) -> str:
    """The method, with its particles if they were chosen."""
    return row["method"] + (f" {row['particles']}" if row.get("particles") else "")


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Columns padded to the same width; the first two to the left, numbers to the right."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(
            c.ljust(w) if k < 2 else c.rjust(w)
            for k, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _cell(spread: Mapping[str, float] | None) -> str:
    if spread is None:
        return "-"
    half = (spread["high"] - spread["low"]) / 2
    return f"{spread['median']:.2f}" + (f"+-{half:.2f}" if half > 0 else "")
