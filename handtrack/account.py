"""The account of a run: what is counted while it goes, its exit code, last line and record."""

import re
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from handtrack.camera import Camera
from handtrack.errors import EXIT_INTERRUPTED, EXIT_SOME_UNDECODABLE, NothingUsableError
from handtrack.evidence.video import VideoInfo
from handtrack.hand.shape import HandShape
from handtrack.output.provenance import Counts, main_side, medians_ms, versions
from handtrack.records import Frame, FrameResult


class TrackerLike(Protocol):
    """What the loop needs of a tracker."""

    timings_ms: dict[str, list[float]]

    @property
    def shape(self) -> HandShape:
        """The hand that is tracked, as far as it is known by now."""
        ...

    def step(self, frame: Frame) -> FrameResult:
        """What is known of the hand in this frame."""
        ...


@dataclass
class RunReport:
    """What came of a run."""

    clip: Path
    out: Path
    counts: Counts
    state: str = "complete"
    sides: Counter[str] = field(default_factory=Counter)
    timings_ms: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    @property
    def exit_code(self) -> int:
        """Zero only if everything the container promises was decoded and a hand was seen."""
        if self.state == "interrupted":
            return EXIT_INTERRUPTED
        if not self.counts.tracked:
            return NothingUsableError.exit_code
        return 0 if self.counts.complete else EXIT_SOME_UNDECODABLE

    @property
    def last_line(self) -> str:
        """Counts, and where the results are."""
        remark = "interrupted; " if self.state == "interrupted" else ""
        if not self.counts.tracked:
            remark += "no hand was found; "
        return f"{self.clip}: {remark}{self.counts.sentence}; results in {self.out}"


def record_of(
    settings: Any,
    info: VideoInfo,
    camera: Camera,
    tracker: TrackerLike,
    report: RunReport,
    elapsed_s: float,
) -> dict[str, Any]:
    """What ``run.json`` says."""
    n = report.counts.decoded + report.counts.undecodable
    space = getattr(tracker, "space", None)
    return {
        "state": report.state,
        "exit_code": report.exit_code,
        "clip": {
            "name": info.path.name,
            "width_px": info.width_px,
            "height_px": info.height_px,
            "stored_width_px": info.stored_width_px,
            "stored_height_px": info.stored_height_px,
            "sample_aspect_ratio": info.sample_aspect_ratio,
            "rotation_applied_clockwise_deg": info.orientation.clockwise_deg,
            "mirror_applied": info.orientation.mirrored,
            "rate_hz": info.rate_hz,
            "duration_s": info.duration_s,
            "codec": info.codec,
            "pixel_format": info.pixel_format,
        },
        "counts": report.counts,
        "side": main_side(report.sides),
        "facing": getattr(tracker, "facing", None),
        "hand": {"calibrated": tracker.shape.calibrated, "source": tracker.shape.source},
        "camera": camera,
        "camera_assumed": camera.assumed,
        "dropped_basis_states": getattr(space, "dropped", None),
        "settings": settings,
        "seed": settings.seed,
        "versions": versions(),
        "frames_per_second": round(n / elapsed_s, 2),
        "peak_memory_mb": peak_memory_mb(),
        "timings_ms": medians_ms(report.timings_ms | dict(tracker.timings_ms)),
    }


def peak_memory_mb() -> float | None:
    """Largest resident size of this process so far, where the system tells it.

    Linux tells it of this program alone; elsewhere a process that was forked may inherit its
    parent's.
    """
    if sys.platform == "linux":
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        if found := re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE):
            return round(int(found[1]) / 2**10, 1)
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (2**20 if sys.platform == "darwin" else 2**10), 1)
