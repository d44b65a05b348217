"""The folder of a run whose every number is known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.output.folder import RunFolder
from handtrack.records import Frame, FrameResult, Pose, Status
from handtrack.report import result_of

CAMERA = Camera.assumed_for(640, 480)
#: A hand that is not the default one.
SHAPE = replace(HandShape.default().scaled(0.93), calibrated=True, source="test")


def results(side: str, times_s: np.ndarray, lost: set[int]) -> list[FrameResult]:
    """Hands at random inside the limits, in view, turned any way."""
    rng = np.random.default_rng(11)
    rows = []
    for k, time_s in enumerate(times_s):
        theta = rng.uniform(LIMITS[:, 0], LIMITS[:, 1])
        pose = Pose(rotation.exp(rng.normal(0, 0.8, 3)), np.array([10.0 * k, 20, 600]))
        estimate = Estimate(pose, theta, np.full(20, 0.05))
        frame = Frame(k, float(time_s), None)
        known = result_of(frame, estimate, Status.TRACKED, 0.9, side, SHAPE, CAMERA)
        rows.append(FrameResult.unknown(k, float(time_s), side=side) if k in lost else known)
    return rows


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., Path]:
    """A function that writes the folder of a run, as ``handtrack run`` does."""

    def make(side: str = "right", times_s=None, lost=frozenset({0, 5})) -> Path:
        times = np.arange(12) / 30 if times_s is None else np.asarray(times_s)
        folder = RunFolder(tmp_path / "clip.handtrack")
        for row in results(side, times, set(lost)):
            folder.add(row, lambda: None)
        folder.finish({"clip": "clip.mp4"}, SHAPE, side, {"hand.toml": SHAPE.save})
        return folder.path

    return make
