"""The commands ``handtrack markers attach``, ``markers rank`` and ``handover``."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.mocap import page
from handtrack.mocap.attach import attach, disturbed, find_mapping
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.database import Database, read_database
from handtrack.mocap.handover import (
    Reconstruction,
    check_query,
    check_side,
    columns,
    in_root,
    reconstruct,
)
from handtrack.mocap.marker_io import read_markers, write_markers
from handtrack.mocap.marker_sets import marker_set
from handtrack.mocap.ranking import rank
from handtrack.mocap.regression import Regression
from handtrack.mocap.result import record_of, report, trajectory_of
from handtrack.mocap.settings import Handover
from handtrack.mocap.sources import Method, rank_sources
from handtrack.output.bvh import write_hand_bvh
from handtrack.output.files import open_whole, output_folder, save_whole
from handtrack.output.provenance import RUN_JSON, versions, write_provenance
from handtrack.output.table import ANGLES_CSV, KEYPOINTS_CSV, TableWriter
from handtrack.trajectory import Trajectory, angle_columns, keypoint_columns

Array = NDArray[np.float64]
Out = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


@dataclass(frozen=True)
class MarkersAttach:
    """Put virtual markers on the moving skeleton of a BVH file."""

    motion: tyro.conf.Positional[Path]
    """The BVH file."""
    set: str = "full13"
    """The marker set: which markers, and where each sits."""
    set_file: Path | None = None
    """A TOML file of marker sets in place of those that ship."""
    mapping: str = "auto"
    """Which joint is which: manipnet, handtrack, a TOML file, or auto."""
    out: Out = Path("markers.c3d")
    """Where to write them: .c3d, .trc, .tsv or .csv."""
    noise_mm: float = 0.0
    """Standard deviation of the measurement noise of a coordinate."""
    dropout: float = 0.0
    """Share of the frames in which a marker is not seen, in gaps."""
    seed: int = 0
    """Seed of the noise and the dropouts."""

    def __call__(self) -> int:
        """Attach, write, say what was done."""
        chosen = marker_set(self.set, self.set_file)
        motion = read_bvh(self.motion)
        try:
            still = attach(motion, find_mapping(motion, self.mapping), chosen)
            rng = np.random.default_rng(self.seed)
            markers = disturbed(still, rng, self.noise_mm, self.dropout)
        except InputError as error:
            raise InputError(f"{self.motion}: {error}") from error
        write_markers(markers, self.out)
        missing = 1 - markers.seen.mean()
        print(
            f"{self.out}: {len(markers.labels)} markers, {markers.n_frames} frames at "
            f"{markers.rate_hz:.4g} Hz, {100 * missing:.1f} % missing"
        )
        return 0


@dataclass(frozen=True)
class MarkersRank:
    """Say which few markers to record: the ranking of the hand-over paper, or a greedy one."""

    database: tyro.conf.Positional[list[str]]
    """BVH files, marker files, or sequences that ship (alphabet)."""
    top: int = 6
    """How many to print first."""
    method: Method = "algorithm1"
    """Algorithm 1, its unweighted variant, or the marker that most lowers the error comes next."""
    components: int = 3
    """Components that the unweighted variant sums over."""
    power: float = 1.0
    """The greedy ranking is for a regression whose weights are 1 / distance to this power,"""
    ridge_mm: float = 0.5
    """that is damped for this noise of a marker coordinate,"""
    close_mm: float = 0.0
    """and whose hand is then brought this near to its markers; 0 leaves it alone."""
    borrow: int = 0
    """So many poses of other hands, which ship, join the data base for it."""
    rounds: int = 1
    """Regressions; from the second on, on the angles of the hand that was closed on its markers."""
    set: str = "full13"
    """The marker set that is attached to BVH files."""
    mapping: str = "auto"
    """Which joint is which: manipnet, handtrack, a TOML file, or auto."""
    root: tuple[str, ...] = ()
    """The root markers; by default those whose name begins with 'root'."""
    out: Out = Path("ranking.png")
    """Where to draw them on a hand."""

    def __call__(self) -> int:
        """Rank, draw, print."""
        if not self.database:
            raise InputError("markers rank needs one source or more")
        if self.top < 1:
            raise InputError(f"--top {self.top}: at least one marker")
        chosen = marker_set(self.set)
        with _progress(self.top, "markers", self.method != "greedy") as bar:
            ranking = rank_sources(
                self.database,
                chosen,
                self.method,
                self.components,
                self.top,
                self.mapping,
                self.root,
                Handover(
                    Regression(0, self.ridge_mm, self.power),
                    close_mm=self.close_mm,
                    borrow=self.borrow,
                    rounds=self.rounds,
                ),
                lambda text: _advance(bar, text),
            )
        picture = page.png(page.draw_ranking(ranking, chosen, ranking.top(self.top)))
        save_whole(self.out, lambda part: part.write_bytes(picture))
        print(f"rank  marker        share   ({ranking.method})")
        for k, (label, share) in enumerate(zip(ranking.order, ranking.share, strict=True), 1):
            print(f"{k:4d}  {label:12s}  {100 * share:4.1f} %{'  *' if k <= self.top else ''}")
        print(f"top {self.top}: {','.join(ranking.top(self.top))}")
        print(f"{self.out}: the markers on a hand")
        return 0


@dataclass(frozen=True)
class HandoverCommand:
    """Reconstruct a whole hand from a few markers and a data base.

    The data base is one or more BVH files (markers recorded beside them, or virtual ones), or
    'alphabet', which ships. Writes angles.csv, keypoints.csv, motion.bvh, report.html and
    run.json.
    """

    query: tyro.conf.Positional[Path]
    """The recording of a few markers and the root: .c3d, .trc, .tsv or .csv."""
    database: list[str]
    """BVH files of whole hands, or sequences that ship (alphabet)."""
    markers: str = ""
    """Markers to use, a,b,c; by default all that both have."""
    out: Out = Path("handover")
    """The folder for the results."""
    set: str = "full13"
    """The marker set that is attached to BVH files without recorded markers."""
    mapping: str = "auto"
    """Which joint is which: manipnet, handtrack, a TOML file, or auto."""
    root: tuple[str, ...] = ()
    """The root markers; by default those whose name begins with 'root'."""
    components: int = 0
    """Principal components of the angles to reconstruct; 0 is all."""
    taps: int = 17
    """Taps of the cone filter at 120 Hz; 1 does not filter."""
    neighbours: int = 0
    """Only so many nearest data base frames vote; 0 lets all (the paper)."""
    ridge_mm: float = 0.5
    """Noise of a marker coordinate that the regression is damped for; 0 is the paper's plain one,
    which a small data base makes wild."""
    power: float = 1.0
    """Data base frames weigh by the inverse distance to this power."""
    window: int = 0
    """Frames before and after that are regressed on too."""
    close_mm: float = 0.0
    """How near the hand is brought to its markers after the regression; 0 leaves it alone."""
    borrow: int = 0
    """So many poses of other hands, which ship, join the data base: fists that it lacks."""
    rounds: int = 1
    """Regressions; from the second on, on the angles of the hand that was closed on its markers."""
    resample: bool = False
    """Bring the query to the frame rate of the data base."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in the query, for motion.bvh."""
    quiet: bool = False
    """Say nothing but errors."""

    def __call__(self) -> int:
        """Read, reconstruct, write."""
        chosen = marker_set(self.set)
        settings = Handover(
            Regression(self.neighbours, self.ridge_mm, self.power),
            self.components,
            self.taps,
            self.window,
            close_mm=self.close_mm,
            borrow=self.borrow,
            rounds=self.rounds,
        )
        base = read_database(self.database, chosen, self.mapping, self.root or None)
        query = read_markers(self.query)
        try:
            if self.resample:
                query = query.resampled(base.rate_hz)
            check_query(base, query)
            names = [m.strip() for m in self.markers.split(",") if m.strip()] or [
                m for m in query.labels if m in base.labels
            ]
            X = columns(base, query.labels, names)
            Q, link = in_root(base, query, names)
            check_side(base, Q, names)
        except InputError as error:
            raise InputError(f"{self.query}: {error}") from error
        with _progress(len(Q), "frames", self.quiet) as bar:
            hand = reconstruct(base, X, Q, settings)
            bar.update(len(Q))
        trajectory = trajectory_of(base, query, Q, link, hand, settings)
        record = {
            "command": "handover",
            "settings": asdict(self),
            "versions": versions(),
            **record_of(base, query, names, link, trajectory),
        }
        self._write(base, query.rate_hz, names, hand, trajectory, record)
        if not self.quiet:
            print(f"{self.out}: {record['counts']['sentence']}")
        return 0

    def _write(
        self,
        base: Database,
        rate_hz: float,
        names: Sequence[str],
        hand: Reconstruction,
        trajectory: Trajectory,
        record: dict[str, Any],
    ) -> None:
        out = output_folder(self.out)
        ranking = rank(base.labels, base.X_mm)
        text = report(
            self.query.name, marker_set(self.set), base, names, ranking, hand, trajectory, record
        )
        tables = [
            TableWriter(out / ANGLES_CSV, angle_columns),
            TableWriter(out / KEYPOINTS_CSV, keypoint_columns),
        ]
        try:
            for table in tables:
                table.write(trajectory)
            write_hand_bvh(
                out / "motion.bvh",
                trajectory.theta,
                trajectory.palm_R,
                trajectory.palm_mm,
                base.shape,
                base.side,
                1 / rate_hz,
                np.eye(3) if self.up == "y" else rotation.about_x(-np.pi / 2),
            )
        except Exception:
            for table in tables:
                table.discard()
            raise
        for table in tables:
            table.finish()
        with open_whole(out / "report.html") as file:
            file.write(text)
        write_provenance(out / RUN_JSON, record)


def _progress(total: int, unit: str, quiet: bool = False) -> "tqdm[None]":
    return tqdm(total=total, unit=unit, disable=quiet or not sys.stderr.isatty())


def _advance(bar: "tqdm[None]", text: str) -> None:
    bar.set_postfix_str(text, refresh=False)
    bar.update()
