"""The accuracy ratchet: a committed baseline that may only improve.

``tests/baseline.json`` holds medians and ranges of a reduced suite. A run is worse if a median is
worse than the baseline's by more than the range of the baseline's own seeds, or by more than
`FLOOR`, whichever is larger; the range of more seeds than two counts less, since their median is
the surer. ``handtrack bench --baseline FILE`` checks, ``--accept`` replaces it.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from handtrack.errors import InputError, OutputError

#: Scores that are held, and the change that is no change. Shares are better when larger.
FLOOR: dict[str, float] = {
    "bend_deg": 0.5,
    "palm_deg": 0.5,
    "keypoints_px": 0.5,
    "jitter_deg": 0.1,
    "tracked_share": 0.02,
}
_LARGER_IS_BETTER = {"tracked_share"}


def worsened(
    summary: Sequence[Mapping[str, Any]], baseline: Sequence[Mapping[str, Any]]
) -> list[str]:
    """A sentence for every score that is worse than the baseline allows, or that is gone."""
    now = {(row["condition"], row["method"]): row["scores"] for row in summary}
    said = []
    for row in baseline:
        where = (row["condition"], row["method"])
        for name, floor in FLOOR.items():
            before = row["scores"].get(name)
            if before is None:
                continue
            after = now.get(where, {}).get(name)
            if after is None:
                said.append(f"{' '.join(where)}: {name} was {before['median']}, now it is missing")
                continue
            sign = -1 if name in _LARGER_IS_BETTER else 1
            change = sign * (after["median"] - before["median"])
            spread = (before["high"] - before["low"]) * (2 / max(row["seeds"], 2)) ** 0.5
            if change > (allowed := max(spread, floor)):
                said.append(
                    f"{' '.join(where)}: {name} was {before['median']}, now {after['median']}; "
                    f"{allowed:.3g} would be allowed"
                )
    return said


def read_baseline(path: Path) -> list[dict[str, Any]]:
    """The rows of a baseline.

    Raises
    ------
    InputError
        It cannot be read, or is something else.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        return list(document["summary"])
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a baseline of handtrack bench") from error


def write_baseline(summary: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Keep of a summary what the ratchet holds.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    rows = [{**row, "scores": {name: row["scores"].get(name) for name in FLOOR}} for row in summary]
    text = json.dumps({"format": "handtrack-baseline", "summary": rows}, indent=1) + "\n"
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
