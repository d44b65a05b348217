"""What the report says of the run as a whole: from its record, without what differs each time.

Timings, memory and frames a second stay in ``run.json``: the same input, settings and seed give
the same page.
"""

from collections.abc import Mapping
from typing import Any

from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_PARENTS
from handtrack.hand.space import ConfigurationSpace
from handtrack.records import Status


def facts_of(record: Mapping[str, Any], space: ConfigurationSpace) -> dict[str, Any]:
    """The facts for the page, of a run's ``record`` and the configuration space it used."""
    clip, counts, settings = record["clip"], record["counts"], record["settings"]
    n = counts.decoded + counts.undecodable
    about = [
        f"{n} frames" if record["state"] == "complete" else f"{n} frames, {record['state']}",
        f"{100 * counts.tracked / max(n, 1):.0f} % tracked",
        f"{record['side']} hand" if record["side"] else "no hand",
        f"method {settings.method}",
        "hand calibrated" if record["hand"]["calibrated"] else "default hand assumed",
        "camera assumed" if record["camera_assumed"] else "camera given",
        f"{clip['width_px']} × {clip['height_px']} px",
        f"seed {record['seed']}",
    ]
    return {
        "clip": clip["name"],
        "about": about,
        "cloud": "Samples" if settings.method == "refined" else "Particles",
        "angles": ANGLE_NAMES,
        "parents": KEYPOINT_PARENTS,
        "basis": [[round(float(x), 4) for x in X[:2]] for X in space.basis_X],
        "basis_names": space.basis_names,
        "sentences": [status.sentence for status in Status],
    }
