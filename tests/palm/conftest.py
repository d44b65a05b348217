"""Scenes for the palm: the outline of a posed hand as the camera would see it."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import TIPS
from handtrack.palm.outline import palm_outline
from handtrack.records import Pose

CAMERA = Camera.assumed_for(640, 480)
SHAPE = HandShape.default()
CENTRE_MM = np.array([0.0, 45.0, 0.0])


@dataclass(frozen=True)
class Scene:
    """A posed hand and its silhouette's edge points, with outward normals."""

    pose: Pose
    theta: np.ndarray
    edges_px: np.ndarray
    edge_normals: np.ndarray
    outline_mm: np.ndarray
    outline_normals: np.ndarray
    tips_mm: np.ndarray
    tips_px: np.ndarray

    def start(self, rng, rotation_rad, shift_mm, over_mm=0.0):
        """A start some way off; ``over_mm`` towards the thumb (a finger is 20 mm)."""
        R = rotation.exp(rng.normal(0, rotation_rad, 3)) @ self.pose.R
        return Pose(R, self.pose.t_mm + rng.normal(0, shift_mm, 3) + R[:, 0] * over_mm)

    def errors(self, pose):
        """Rotation in degrees, palm centre in pixels."""
        turn = np.degrees(rotation.angle_between(pose.R, self.pose.R))
        off = CAMERA.project(pose @ CENTRE_MM) - CAMERA.project(self.pose @ CENTRE_MM)
        return turn, np.linalg.norm(off)


def discs(points_mm, radii_mm, pose, mask):
    """Fill chains of discs: fingers and forearm, as seen by the camera."""
    for chain, radii in zip(points_mm, radii_mm, strict=True):
        along = np.linspace(0, len(chain) - 1, 40 * (len(chain) - 1))
        index = np.arange(len(chain))
        points = np.stack([np.interp(along, index, chain[:, i]) for i in range(3)], axis=1)
        X = pose @ points
        r = np.interp(along, index, radii) * CAMERA.fx_px / X[:, 2]
        for (x, y), radius in zip(CAMERA.project(X), r, strict=True):
            centre = (round(x * 16), round(y * 16))
            cv2.circle(mask, centre, round(radius * 16), 255, -1, cv2.LINE_8, 4)


def silhouette(pose, theta):
    mask = np.zeros((480, 640), np.uint8)
    joints = keypoints_mm(theta, SHAPE)[1:].reshape(5, 4, 3)
    discs(joints, SHAPE.radius_mm, pose, mask)
    arm = np.array([[[0.0, -4, 0], [0, -200, 0]]])
    discs(arm, np.full((1, 2), SHAPE.wrist_radius_mm), pose, mask)
    flat = np.column_stack([SHAPE.palm_outline_mm, np.zeros(len(SHAPE.palm_outline_mm))])
    polygon = np.round(CAMERA.project(pose @ flat) * 16).astype(np.int32)
    cv2.fillPoly(mask, [polygon], 255, cv2.LINE_8, 4)
    return mask


def edges_of(mask):
    """Every second contour point, smoothed, and its outward normal."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    ring = max(contours, key=len)[:, 0].astype(float)
    smooth = np.mean([np.roll(ring, k, axis=0) for k in range(-3, 4)], axis=0)
    tangent = np.roll(smooth, -2, axis=0) - np.roll(smooth, 2, axis=0)
    x, y = smooth.T
    turn = np.sign(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    normal = turn * np.column_stack([tangent[:, 1], -tangent[:, 0]])
    length = np.linalg.norm(normal, axis=1)
    inside = (ring > 2).all(axis=1) & (ring < (637, 477)).all(axis=1) & (length > 0)
    return smooth[inside][::2], (normal[inside] / length[inside, None])[::2]


@pytest.fixture(scope="session")
def make_scene():
    def make(rng, tilt_rad=0.5):
        direction = rng.uniform(-np.pi, np.pi)
        lean = np.array([np.cos(direction), np.sin(direction), 0])
        R = rotation.exp(tilt_rad * rng.uniform(0.2, 1) * lean) @ np.diag([1.0, -1, -1])
        pose = Pose(
            R @ rotation.about_z(rng.normal(0, 0.3)),
            np.array([rng.uniform(-60, 60), rng.uniform(30, 90), rng.uniform(380, 520)]),
        )
        theta = np.zeros(20)
        theta[1] = 0.3
        theta[4::4], theta[6::4] = rng.uniform(0, 0.3, 4), rng.uniform(0, 0.6, 4)
        theta[5::4] = rng.normal([0.15, 0, -0.1, -0.2], 0.05)
        edges, normals = edges_of(silhouette(pose, theta))
        tips = keypoints_mm(theta, SHAPE)[list(TIPS)]
        outline = palm_outline(SHAPE, theta)
        return Scene(pose, theta, edges, normals, *outline, tips, CAMERA.project(pose @ tips))

    return make
