"""The outline that people look at: round the hand it belongs to, mirrored for a left one."""

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.outline import outline_px
from handtrack.hand.shape import HandShape
from handtrack.hand.surface import Capsules
from handtrack.records import Pose

SHAPE = HandShape.default()
SURFACE = Capsules(SHAPE)
CAMERA = Camera(600, 600, 330, 235, 640, 480)
MIRROR = np.array([-1.0, 1.0, 1.0])


def some_pose(seed):
    rng = np.random.default_rng(seed)
    R = rotation.exp(rng.normal(0, 0.4, 3)) @ rotation.about_x(np.pi)
    theta = rng.uniform(0, 0.8, 20)
    return theta, Pose(R, np.array([10.0, 60.0, 480.0]) + rng.normal(0, 15, 3))


def is_inside(polygons, point):
    inside = [cv2.pointPolygonTest(p.astype(np.float32), point, False) >= 0 for p in polygons]
    return sum(inside) % 2 == 1  # in a hole it is inside two of them


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("side", ["right", "left"])
def test_keypoints_but_the_tips_lie_inside(seed, side):
    theta, pose = some_pose(seed)
    points = keypoints_mm(theta, SHAPE) * (MIRROR if side == "left" else 1)
    polygons = outline_px(theta, pose, side, SURFACE, CAMERA)
    joints = CAMERA.project(pose @ points)[[k for k in range(1, 21) if k % 4]]
    assert all(is_inside(polygons, tuple(map(float, point))) for point in joints)
    assert not is_inside(polygons, (5.0, 5.0))


def test_left_hand_is_the_mirror_image():
    theta, pose = some_pose(5)
    mirrored = Pose(pose.R * np.outer(MIRROR, MIRROR), pose.t_mm * MIRROR)
    right = outline_px(theta, pose, "right", SURFACE, CAMERA)
    left = outline_px(theta, mirrored, "left", SURFACE, CAMERA.mirrored())
    for a, b in zip(right, left, strict=True):
        np.testing.assert_allclose(b, (CAMERA.width_px - 1, 0) + a * (-1, 1), atol=1e-9)


@pytest.mark.parametrize(
    ("theta", "t_mm"), [(np.full(20, np.nan), [0, 0, 500.0]), (np.zeros(20), [0, 0, -500.0])]
)
def test_unknown_hand_has_no_outline(theta, t_mm):
    assert outline_px(theta, Pose(np.eye(3), np.array(t_mm)), "right", SURFACE, CAMERA) == []
