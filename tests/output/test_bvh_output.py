"""Our hand as BVH: the same keypoints, the same angles, upright."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import KEYPOINT_NAMES, LIMITS
from handtrack.mocap.bvh import read_bvh
from handtrack.mocap.hand_motion import UPRIGHT, hand_motion
from handtrack.mocap.mapping import read_mapping
from handtrack.output.bvh import write_hand_bvh

ANGLE_TOLERANCE_DEG = 1e-3
POINT_TOLERANCE_MM = 1e-9


def angles_of(motion):
    return read_mapping("handtrack").theta(motion)[0]


@pytest.fixture
def movement() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    theta = rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (12, 20))
    return theta, rotation.exp(rng.normal(size=(12, 3))), rng.normal(0, 100, (12, 3))


@pytest.mark.parametrize("side", ["right", "left"])
def test_skeleton_has_the_keypoints_of_the_kinematics(movement, side):
    theta, R, t = movement
    shape = HandShape.default()
    world = hand_motion(theta, R, t, shape, side).world()
    S = np.diag([-1.0, 1, 1]) if side == "left" else np.eye(3)
    palm = keypoints_mm(theta, shape) @ S
    expected = (np.einsum("fij,fkj->fki", R, palm) + t[:, None]) @ UPRIGHT.T
    motion = hand_motion(theta, R, t, shape, side)
    for k, name in enumerate(KEYPOINT_NAMES):
        got = world.ends[:, (k // 4) - 1] if name.endswith("_tip") else None
        got = world.joints[:, motion.index(name)] if got is None else got
        np.testing.assert_allclose(got, expected[:, k], atol=POINT_TOLERANCE_MM)


@pytest.mark.parametrize("side", ["right", "left"])
def test_file_reads_back_to_the_same_angles(movement, side, tmp_path):
    theta, R, t = movement
    write_hand_bvh(tmp_path / "m.bvh", theta, R, t, HandShape.default(), side, 1 / 120)
    motion = read_bvh(tmp_path / "m.bvh")
    assert np.degrees(abs(angles_of(motion) - theta)).max() < ANGLE_TOLERANCE_DEG
    assert motion.frame_time_s == 1 / 120


def test_hand_pointing_up_in_the_picture_points_up_in_the_file():
    # palm y (to the fingers) is up in the image: camera -y
    R = np.diag([1.0, -1.0, -1.0])[None]
    theta = np.zeros((1, 20))
    world = hand_motion(theta, R, np.zeros((1, 3)), HandShape.default()).world()
    assert world.ends[0, 2, 1] > 150  # the middle fingertip is above the wrist


def test_unknown_frames_hold_the_last_pose(movement):
    theta, R, t = (a.copy() for a in movement)
    theta[[0, 5]], t[5] = np.nan, np.nan
    got = angles_of(hand_motion(theta, R, t, HandShape.default()))
    np.testing.assert_allclose(got[[0, 5]], theta[[1, 4]], atol=1e-12)
    with pytest.raises(InputError, match="not known in any frame"):
        hand_motion(np.full((2, 20), np.nan), R[:2], t[:2], HandShape.default())


def test_turning_palm_has_no_jumps_in_its_channels():
    angle = np.linspace(0, 4 * np.pi, 200)
    motion = hand_motion(
        np.zeros((200, 20)), rotation.about_z(angle), np.zeros((200, 3)), HandShape.default()
    )
    assert abs(np.diff(motion.values[:, :6], axis=0)).max() < 10
