"""The motion of a run as BVH, written in pieces."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import OutputError
from handtrack.hand.shape import HandShape
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.hand_motion import hand_motion
from handtrack.output import motion
from handtrack.output.motion import MotionWriter
from handtrack.records import FrameResult, Status

SHAPE = HandShape.default()


def results(n, lost):
    rng = np.random.default_rng(0)
    for k in range(n):
        unknown = FrameResult.unknown(k, 0.04 * k)
        known = {
            "status": Status.TRACKED,
            "R": rotation.exp(rng.normal(0, 0.3, 3)),
            "t_mm": rng.normal(0, 50, 3),
            "theta": rng.uniform(0, 1, 20),
        }
        yield unknown if k in lost else FrameResult(**vars(unknown) | known)


@pytest.mark.parametrize("lost", [set(), {0, 1, 5}, {0, 1, 2, 3, 4, 5, 9, 10}])
@pytest.mark.parametrize("side", ["right", "left"])
def test_pieces_are_the_whole(lost, side, tmp_path, monkeypatch):
    monkeypatch.setattr(motion, "N_AT_A_TIME", 4)
    frames = list(results(11, lost))
    writer = MotionWriter(tmp_path / "motion.bvh")
    for frame in frames:
        writer.add(frame)
    writer.finish(SHAPE, side)
    whole = hand_motion(
        np.array([f.theta for f in frames]),
        np.array([f.R for f in frames]),
        np.array([f.t_mm for f in frames]),
        SHAPE,
        side,
        0.04,
    )
    found = read_bvh(tmp_path / "motion.bvh")
    assert found.names == whole.names
    assert found.frame_time_s == pytest.approx(0.04)
    np.testing.assert_allclose(found.values, whole.values, rtol=0, atol=1e-9)
    assert [p.name for p in tmp_path.iterdir()] == ["motion.bvh"]


@pytest.mark.parametrize("lost", [set(range(5)), None])
def test_no_known_frame_no_file(lost, tmp_path):
    writer = MotionWriter(tmp_path / "motion.bvh")
    for frame in results(5, lost) if lost else ():
        writer.add(frame)
    writer.finish(SHAPE, "right")
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_not_there(tmp_path):
    with pytest.raises(OutputError, match=r"motion\.bvh: cannot be written"):
        MotionWriter(tmp_path / "none" / "motion.bvh")
