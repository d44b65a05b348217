"""The folder of a run: two tables and a film that grow frame by frame, and the record of the run.

Everything is written under hidden names and put in its place at the end, together, so the folder
holds the results of one run and not of two.
"""

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from handtrack.errors import OutputError
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.layers import FrameLayers
from handtrack.output.files import output_folder, save_whole
from handtrack.output.motion import MOTION_BVH, MotionWriter
from handtrack.output.overlay import OVERLAY_MP4, Image, OverlayWriter
from handtrack.output.provenance import RUN_JSON, write_provenance
from handtrack.output.report.curves import TrueMotion
from handtrack.output.report.facts import facts_of
from handtrack.output.report.writer import (
    REPORT_FILES,
    REPORT_HTML,
    ReportWriter,
    remove_files,
)
from handtrack.output.table import ANGLES_CSV, KEYPOINTS_CSV, TableWriter
from handtrack.records import FrameResult
from handtrack.trajectory import Trajectory, angle_columns, keypoint_columns

#: Every file that a run of ours may leave in its folder.
FILES = (
    *(ANGLES_CSV, KEYPOINTS_CSV, OVERLAY_MP4, RUN_JSON),
    *("hand.toml", "camera.toml", MOTION_BVH, REPORT_HTML),
)


class RunFolder:
    """Takes the frames as they come.

    Raises
    ------
    OutputError
        The folder cannot be written in, or holds files of the same names that are not ours.
    """

    def __init__(self, path: Path) -> None:
        theirs = [name for name in (*FILES, REPORT_FILES) if (path / name).exists()]
        if theirs and RUN_JSON not in theirs:
            raise OutputError(
                f"{path}: has a {theirs[0]} and no {RUN_JSON}, so it is no folder of ours; "
                "choose another with --out"
            )
        self.path = output_folder(path)
        self._tables = [
            TableWriter(self.path / ANGLES_CSV, angle_columns),
            TableWriter(self.path / KEYPOINTS_CSV, keypoint_columns),
        ]
        self._motion = MotionWriter(self.path / MOTION_BVH)
        self._overlay: OverlayWriter | None = None
        self._report: ReportWriter | None = None
        self._for_report: tuple[ConfigurationSpace, TrueMotion | None] | None = None

    def film(self, size: tuple[int, int], time_base: Fraction, sound_of: Path | None) -> None:
        """Have an overlay film made too."""
        self._overlay = OverlayWriter(self.path / OVERLAY_MP4, *size, time_base, sound_of)

    def report(
        self, size: tuple[int, int], space: ConfigurationSpace, truth: TrueMotion | None
    ) -> None:
        """Have a report made too, with the truth beside the result if it is known."""
        self._report, self._for_report = ReportWriter(self.path, *size), (space, truth)

    def show(
        self,
        result: FrameResult,
        image: Image | None,
        layers: Callable[[], FrameLayers],
        ms: float,
    ) -> None:
        """The same frame for the report: as filmed, what it shows, and how long it took."""
        if self._report is not None:
            self._report.add(result, image, layers, ms)

    def add(self, result: FrameResult, draw: Callable[[], Image]) -> None:
        """One more frame; ``draw`` gives its picture for the film."""
        piece = Trajectory.from_results([result])
        for table in self._tables:
            table.write(piece)
        self._motion.add(result)
        if self._overlay is not None:
            self._overlay.add(result.time_s, draw)

    def finish(
        self,
        record: Mapping[str, Any],
        shape: HandShape,
        side: str,
        extra: Mapping[str, Callable[[Path], None]],
    ) -> None:
        """Put everything in its place; what an earlier run left and this one did not make goes.

        Every file is tried, and the first fault is raised after the last of them. The motion is of
        a hand of this ``shape`` and ``side``; ``extra`` has more files, each with the function that
        writes it.
        """
        before = {path: _inode(path) for path in (self.path / name for name in FILES)}
        steps: list[Callable[[], None]] = [table.finish for table in self._tables]
        steps.append(partial(self._motion.finish, shape, side))
        steps += [partial(save_whole, self.path / name, save) for name, save in extra.items()]
        if self._overlay is not None:
            steps.append(self._overlay.finish)
        steps.append(partial(self._finish_report, record))
        steps.append(lambda: write_provenance(self.path / RUN_JSON, record))
        faults = [fault for step in steps if (fault := _fault_of(step)) is not None]
        for path, inode in before.items():
            if inode is not None and _inode(path) == inode:
                path.unlink()  # of an earlier run: this one put nothing in its place
        if faults:
            raise faults[0]

    def _finish_report(self, record: Mapping[str, Any]) -> None:
        if self._report is None or self._for_report is None:
            remove_files(self.path)
        else:
            space, truth = self._for_report
            self._report.finish(facts_of(record, space), truth)

    def discard(self) -> None:
        """Leave nothing of this run behind."""
        if self._report is not None:
            self._report.discard()
        for table in self._tables:
            table.discard()
        self._motion.discard()
        if self._overlay is not None:
            self._overlay.discard()


def _inode(path: Path) -> int | None:
    return path.stat().st_ino if path.exists() else None


def _fault_of(step: Callable[[], None]) -> Exception | None:
    try:
        step()
    except Exception as fault:
        return fault
    return None
