"""A view of a hand drawn with exact distances: no picture, no segmentation."""

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.hand.capsules import CapsuleHand, capsule_distance
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace, default
from handtrack.records import Pose
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings

K = np.array([400.0, 400.0, 119.5, 119.5])
SIDE = 240


def union_distance(hand: CapsuleHand, theta: np.ndarray, pose: Pose) -> np.ndarray:
    """Signed distance ``(SIDE, SIDE)`` to the model's outline, exact outside."""
    circles = hand.circles_px(theta[None], pose.R, pose.t_mm, K)[0]
    out = np.full((SIDE, SIDE), 1e3)
    for a, b in hand.capsule_node:
        for y in range(SIDE):
            for x in range(SIDE):
                d = capsule_distance(x, y, *circles[a, :3], *circles[b, :3])[0]
                out[y, x] = min(out[y, x], d)
    return out


def view_of_distance(sdf: np.ndarray) -> View:
    """The view whose silhouette is ``sdf < 0``; no edges inside."""
    gy, gx = np.gradient(sdf)
    near = (np.abs(sdf) < 0.5) & (np.hypot(gx, gy) > 0.5)
    y, x = np.nonzero(near)
    normal = np.stack([gx[near], gy[near]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    contour = np.stack([x, y], axis=1) - normal * sdf[near][:, None]
    step = max(1, len(contour) // 170)
    nothing = np.zeros(sdf.shape, np.float32)
    return View(
        contour=contour[::step],
        normal=normal[::step],
        inner=np.empty((0, 5)),
        sdf=sdf.astype(np.float32),
        edge_strength=nothing,
        edge_x=nothing,
        edge_y=nothing,
        intrinsics=K,
        valid=np.array([0.0, 0.0, SIDE, SIDE]),
        grey=np.zeros(sdf.shape, np.uint8),
    )


@pytest.fixture(scope="session")
def space() -> ConfigurationSpace:
    return default()


@pytest.fixture(scope="session")
def method(space: ConfigurationSpace) -> RefinedMethod:
    return RefinedMethod(HandShape.default(), space, RefinedSettings())


@pytest.fixture(scope="session")
def truth() -> tuple[Pose, np.ndarray]:
    """A hand turned a little, index and ring half bent."""
    pose = Pose(
        rotation.exp([0.1, 0.15, 0.1]) @ np.diag([1.0, -1.0, -1.0]), np.array([5.0, 75.0, 420.0])
    )
    theta = np.zeros(20)
    theta[[1, 4, 6, 7, 12, 14, 15]] = [0.3, 0.7, 0.8, 0.5, 0.6, 0.7, 0.4]
    return pose, theta


@pytest.fixture(scope="session")
def fist() -> tuple[Pose, np.ndarray]:
    """A fist, upright and frontal."""
    pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 60.0, 420.0]))
    theta = np.zeros(20)
    theta[4:] = np.tile(np.radians([75.0, 0.0, 90.0, 50.0]), 4)
    return pose, theta


@pytest.fixture(scope="session")
def view_of_fist(method: RefinedMethod, fist: tuple[Pose, np.ndarray]) -> View:
    """The fist with a bare forearm below it, as wide as its wrist."""
    pose, theta = fist
    sdf = union_distance(method.hand, theta, pose)
    end = (pose @ np.zeros((1, 3)))[0]
    px = end[:2] / end[2] * K[:2] + K[2:]
    half = K[0] * method.shape.wrist_radius_mm / end[2]
    y, x = np.mgrid[:SIDE, :SIDE]
    arm = np.maximum(np.abs(x - px[0]) - half, px[1] - y)
    outside = np.minimum(sdf, arm)
    inside = cv2.distanceTransform((outside < 0).astype(np.uint8), cv2.DIST_L2, 5)
    return view_of_distance(np.where(outside < -1, np.minimum(outside, -inside), outside))


@pytest.fixture(scope="session")
def view(method: RefinedMethod, truth: tuple[Pose, np.ndarray]) -> View:
    return view_of_distance(union_distance(method.hand, truth[1], truth[0]))
