"""A hand of filled tapered capsules, drawn with OpenCV: the truth that calibration is held to.

Nothing here is shared with the fit but the kinematics: webs, the ball of the thumb, the forearm and
the sleeve's cut are drawn, which the fit does not model.
"""

import itertools
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.evidence.video import read_frames
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Pose

SHIFT = 4  # fractional bits of OpenCV's drawing
FINER = 4  # drawn this many times larger, so that a pixel is hand if most of it is


@dataclass(frozen=True)
class DrawnHand:
    """A picture of a right hand (``flip`` makes the left one of it) and everything true of it."""

    mask: np.ndarray  # (h, w) bool
    camera: Camera
    shape: HandShape
    pose: Pose
    theta: np.ndarray
    keypoints_px: np.ndarray  # (21, 2)


def random_shape(rng: np.random.Generator) -> HandShape:
    """A hand that differs from the default one as people do."""
    default = HandShape.default()
    length = default.length_mm * np.exp(rng.normal(0, 0.06))
    length = length * np.exp(rng.normal(0, 0.05, (5, 1))) * np.exp(rng.normal(0, 0.025, (5, 3)))
    radius = default.radius_mm * np.exp(rng.normal(0, 0.08)) * np.exp(rng.normal(0, 0.03, (5, 4)))
    base = default.base_mm + rng.normal(0, 2.0, (5, 3)) * (1, 1, 0.5)
    base[2] = default.base_mm[2]
    turn = rotation.about_z(np.radians(rng.normal(0, (5, 2, 0.5, 2, 2))))
    roll = rotation.about_y(np.radians(rng.normal(0, (6, 3, 1, 3, 3))))
    rest = rotation.log(turn @ rotation.exp(default.rest_rotvec) @ roll)
    return replace(default, base_mm=base, rest_rotvec=rest, length_mm=length, radius_mm=radius)


def random_open_hand(
    rng: np.random.Generator,
    tilt_deg: float = 10.0,
    turn_deg: float = 180.0,
    height_px: int = 200,
    facing: str = "palm",
    palm_for_fingers: float = 1.0,
) -> DrawnHand:
    """An open right hand about ``height_px`` tall: random shape, spread, pose, sleeve.

    ``palm_for_fingers`` makes the palm so much longer, and the fingers shorter.
    """
    shape = random_shape(rng)
    shape = replace(
        shape,
        base_mm=shape.base_mm * (1, palm_for_fingers, 1),
        length_mm=shape.length_mm / palm_for_fingers,
    )
    theta = np.zeros(20)
    theta[[5, 9, 13, 17]] = np.radians(np.array([6, 0, -5, -10]) + rng.normal(0, 3, 4))
    theta[[4, 8, 12, 16]] = np.radians(rng.uniform(0, 10))
    theta[[6, 7, 10, 11, 14, 15, 18, 19]] = np.radians(rng.uniform(0, 8, 8))
    theta[:4] = np.radians(np.array([0, 5, 12, 5]) + rng.normal(0, (6, 8, 8, 8)))
    frontal = np.diag([1.0, -1.0, -1.0]) if facing == "palm" else np.diag([-1.0, -1.0, 1.0])
    tilt = rng.uniform(0, np.radians(tilt_deg)) * np.array([*_direction(rng), 0.0])
    turn = np.radians(rng.uniform(-turn_deg, turn_deg))
    R = rotation.exp(tilt) @ rotation.exp([0, 0, turn]) @ frontal
    side_px = round(2.1 * height_px)
    camera = Camera.assumed_for(side_px, side_px)
    depth = camera.fx_px * 190.0 / height_px * rng.uniform(0.95, 1.1)
    middle = R @ np.array([0.0, 85.0, 0.0])
    pose = Pose(R, np.array([*rng.uniform(-12, 12, 2), depth]) - middle * (1, 1, 0))
    mask = draw(shape, pose, theta, camera, rng)
    return DrawnHand(
        mask, camera, shape, pose, theta, camera.project(pose @ keypoints_mm(theta, shape))
    )


def draw(
    shape: HandShape, pose: Pose, theta: np.ndarray, camera: Camera, rng: np.random.Generator
) -> np.ndarray:
    """The hand's mask ``(h, w)``: fingers, palm, webs, ball of the thumb, forearm to a cuff."""
    canvas = np.zeros((camera.height_px * FINER, camera.width_px * FINER), np.uint8)
    k = keypoints_mm(theta, shape)

    def capsule(a: np.ndarray, ra: float, b: np.ndarray, rb: float) -> None:
        X = pose @ np.stack([a, b])
        centres, radii = camera.project(X), camera.fx_px * np.array([ra, rb]) / X[:, 2]
        around = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        ring = np.stack([np.cos(around), np.sin(around)], axis=1)
        points = np.concatenate([c + r * ring for c, r in zip(centres, radii, strict=True)])
        _fill(canvas, cv2.convexHull(points.astype(np.float32))[:, 0])

    def patch(*corners: np.ndarray) -> None:
        _fill(canvas, camera.project(pose @ np.stack(corners)))

    for d in range(5):
        first, r = 1 + 4 * d, shape.radius_mm[d]
        end = k[first + 3] - r[3] * _unit(k[first + 3] - k[first + 2])
        for a, b in itertools.pairwise(range(4)):
            capsule(k[first + a], r[a], end if b == 3 else k[first + b], r[b])
    web = rng.uniform(0.46, 0.54)
    for d in (1, 2, 3):
        a, b = 1 + 4 * d, 5 + 4 * d
        patch(k[a], k[b], k[b] + web * (k[b + 1] - k[b]), k[a] + web * (k[a + 1] - k[a]))
    wrist = shape.wrist_radius_mm * rng.uniform(0.85, 1.05)
    side = np.array([wrist, 0.0, 0.0])
    patch(side, k[1], k[5] + [6, 0, 0], k[9], k[13], k[17] - [6, 0, 0], [-44, 35, 0], -side)
    patch(k[1], k[1] + 0.75 * (k[2] - k[1]), k[5] + [8, -8, 0], k[17])
    capsule(np.array([-30.0, 25, 0]), 15.0, k[17], shape.radius_mm[4, 0])
    bend = rotation.about_z(np.radians(rng.uniform(-12, 12)))
    cuff = rng.uniform(50, 120)
    neck = np.array([0.0, -rng.uniform(2, 8), 0.0])
    end, wide = neck + bend @ np.array([0.0, -cuff, 0.0]), 1.0 + 0.0025 * cuff
    patch(1.05 * side, 0.95 * side + neck, neck - 0.95 * side, -1.05 * side)
    patch(
        0.95 * side + neck, neck - 0.95 * side, end - wide * bend @ side, end + wide * bend @ side
    )
    size = (camera.width_px, camera.height_px)
    return cv2.resize(canvas, size, interpolation=cv2.INTER_AREA) > 127


def _fill(canvas: np.ndarray, points_px: np.ndarray) -> None:
    fine = (points_px + 0.5) * FINER - 0.5
    cv2.fillPoly(canvas, [np.round(fine * 2**SHIFT).astype(np.int32)], 255, shift=SHIFT)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def _direction(rng: np.random.Generator) -> np.ndarray:
    return _unit(rng.normal(size=2))


@pytest.fixture(scope="session")
def open_hand():
    """The function that draws a random open hand."""
    return random_open_hand


@pytest.fixture(scope="session")
def first_frame_mask():
    """The function that gives the silhouette of a clip's first frame by a plain skin rule."""

    def mask_of(path):
        frame = next(iter(read_frames(path)))
        ycc = cv2.cvtColor(frame.image, cv2.COLOR_RGB2YCrCb).astype(int)
        skin = cv2.medianBlur((ycc[..., 1] - ycc[..., 2] > 8).astype(np.uint8), 5)
        _, label, stats, _ = cv2.connectedComponentsWithStats(skin)
        return label == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])

    return mask_of
