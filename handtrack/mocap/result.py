"""A reconstruction as everything else has it: a trajectory, and a page to look at."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.hand.kinematics import keypoints_mm
from handtrack.mocap import page
from handtrack.mocap.database import Database
from handtrack.mocap.handover import Reconstruction
from handtrack.mocap.marker_sets import MarkerSet
from handtrack.mocap.markers import Gap, Markers
from handtrack.mocap.ranking import Ranking
from handtrack.mocap.root import RootLink
from handtrack.mocap.settings import Handover
from handtrack.records import Status
from handtrack.trajectory import Trajectory

Array = NDArray[np.float64]


def trajectory_of(
    base: Database,
    query: Markers,
    Q_mm: Array,
    link: RootLink,
    hand: Reconstruction,
    settings: Handover,
) -> Trajectory:
    """The reconstruction with its palm pose, as every other method gives it."""
    F = len(Q_mm)
    share = np.isfinite(Q_mm).all(axis=-1).mean(axis=1)
    whole = (share == 1) & np.isfinite(link.residual_mm)
    status = np.where(whole, Status.TRACKED.value, Status.PREDICTED.value)
    status = np.where(share > 0, status, Status.LOST.value)
    known = (share > 0)[:, None]
    mirror = np.array([-1.0 if base.side == "left" else 1.0, 1, 1])
    points = link.to_world(keypoints_mm(hand.theta, base.shape) * mirror)
    return Trajectory(
        frame=np.arange(F),
        time_s=np.arange(F) / query.rate_hz,
        status=status,
        side=np.full(F, base.side),
        confidence=share,
        ess=np.full(F, np.nan),
        palm_mm=np.where(known, link.t_mm, np.nan),
        palm_wxyz=np.where(known, rotation.to_quaternion(link.R), np.nan),
        theta=hand.theta,
        theta_std=hand.std,
        keypoints_px=np.full((F, 21, 2), np.nan),
        keypoints_mm=points,
        provenance={"method": "handover", "settings": asdict(settings)},
    )


def report(
    query_name: str,
    chosen: MarkerSet,
    base: Database,
    names: Sequence[str],
    ranking: Ranking,
    hand: Reconstruction,
    trajectory: Trajectory,
    record: dict[str, Any],
) -> str:
    """The page of a hand-over: counts, angles, components, markers on the hand, gaps."""
    time_s = trajectory.time_s
    gaps = [Gap(**g) for g in record["query"]["gaps"]]
    std = np.degrees(np.nanmedian(trajectory.theta_std))
    parts = [
        page.paragraph(str(record["counts"]["sentence"])),
        page.paragraph(
            f"Data base: {', '.join(base.sources)}, {len(base.theta)} frames, {base.side} hand. "
            f"Markers: {', '.join(names)}. Median stated standard deviation {std:.1f} deg."
        ),
        page.picture(
            page.draw_angles(time_s, trajectory.theta, trajectory.theta_std), "angles over time"
        ),
        page.picture(
            page.draw_components(time_s, {"reconstructed": hand.scores}), "components over time"
        ),
        page.picture(page.draw_ranking(ranking, chosen, names), "markers"),
        page.paragraph("Orange: the markers used; numbers: their rank by Algorithm 1."),
    ]
    if gaps:
        rows = [asdict(gap) for gap in gaps[:200]]
        parts += ["<h2>Gaps</h2>", page.table(rows)]
    return page.page(f"Hand-over of {query_name}", parts)


def record_of(
    base: Database, query: Markers, names: Sequence[str], link: RootLink, hand: Trajectory
) -> dict[str, Any]:
    """What bears on a reconstruction: counts, the data base, the query and its gaps."""
    n = {s.value: int(hand.is_status(s).sum()) for s in Status}
    gaps = [*query.select(names).gaps(), *link.bridged]
    sentence = (
        f"{len(hand)} frames from {len(names)} markers: {n['tracked']} with all of them, "
        f"{n['predicted']} with some or a bridged root, {n['lost']} with none"
    )
    residual = link.residual_mm[np.isfinite(link.residual_mm)]
    return {
        "counts": {**n, "sentence": sentence},
        "database": {
            "sources": base.sources,
            "frames": len(base.theta),
            "rate_hz": base.rate_hz,
            "side": base.side,
            "root": base.root,
        },
        "query": {
            "frames": query.n_frames,
            "rate_hz": query.rate_hz,
            "unit": query.unit,
            "markers": list(names),
            "gaps": [asdict(gap) for gap in gaps],
            "root_residual_mm": float(np.median(residual)),
        },
    }
