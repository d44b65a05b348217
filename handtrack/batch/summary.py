"""What came of a batch: a table for people and an exit code for scripts.

>>> from handtrack.batch.status import ClipStatus, State
>>> done = ClipStatus("/a.mp4", State.COMPLETE, exit_code=0)
>>> exit_code([done]), exit_code([done, ClipStatus("/b.mp4", State.FAILED, exit_code=2)])
(0, 6)
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from handtrack.batch.status import ClipStatus, State
from handtrack.errors import (
    EXIT_INTERRUPTED,
    EXIT_SOME_CLIPS_FAILED,
    EXIT_SOME_UNDECODABLE,
    NothingUsableError,
)


def exit_code(statuses: Sequence[ClipStatus]) -> int:
    """0 all complete; 5 all gone through, some with undecodable frames; 6 a clip without result.

    130 where the batch was stopped before it was through.
    """
    if any(s.state not in (State.COMPLETE, State.FAILED) for s in statuses):
        return EXIT_INTERRUPTED
    codes = {s.exit_code for s in statuses}
    if any(s.state is State.FAILED for s in statuses) or NothingUsableError.exit_code in codes:
        return EXIT_SOME_CLIPS_FAILED
    return EXIT_SOME_UNDECODABLE if EXIT_SOME_UNDECODABLE in codes else 0


def outcome_of(status: ClipStatus, is_new: bool = True) -> str:
    """The outcome of a clip in two or three words."""
    if status.state is not State.COMPLETE:
        return status.state.value
    words = {
        NothingUsableError.exit_code: "no hand",
        EXIT_SOME_UNDECODABLE: "some undecodable",
    }.get(status.exit_code or 0, "complete")
    return words if is_new else f"{words} (before)"


def table(statuses: Mapping[str, tuple[ClipStatus, bool]]) -> str:
    """A line a clip: folder, outcome, frames, tracked, seconds, and what is wrong if anything."""
    rows = [("folder", "outcome", "frames", "tracked", "seconds", "")]
    for name, (status, is_new) in statuses.items():
        n = status.counts
        rows.append(
            (
                name,
                outcome_of(status, is_new),
                str(n.get("decoded", "")),
                str(n.get("tracked", "")),
                f"{status.seconds:.1f}" if status.seconds else "",
                "" if status.is_finished else status.last_line,
            )
        )
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    return "\n".join(_line(row, widths) for row in rows)


def sentence(statuses: Sequence[tuple[ClipStatus, bool]], out: Path) -> str:
    """The last line."""
    n_new = sum(s.is_finished and new for s, new in statuses)
    n_before = sum(s.is_finished and not new for s, new in statuses)
    n_left = len(statuses) - n_new - n_before
    return (
        f"{len(statuses)} clips: {n_new} done, {n_before} done before, "
        f"{n_left} without result; results in {out}"
    )


def _line(row: tuple[str, ...], widths: list[int]) -> str:
    left = (text.ljust(width) for text, width in zip(row[:2], widths[:2], strict=True))
    right = (text.rjust(width) for text, width in zip(row[2:5], widths[2:], strict=True))
    return "  ".join((*left, *right, row[5])).rstrip()
