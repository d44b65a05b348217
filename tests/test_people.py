"""A face is no hand: heads drawn before a wall, alone and behind a hand that leaves."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib.hand import calibrate_hand
from handtrack.camera import Camera
from handtrack.hand.space import default
from handtrack.records import Frame, Status
from handtrack.tracker import Tracker, TrackerSettings
from synth.actor import make_actor
from synth.clip import frames
from synth.scene import Scene

W, H = 320, 240
CAMERA = Camera.assumed_for(W, H)
#: Skin, hair and wall.
PEOPLE = {
    "pale": ((224, 172, 140), (70, 50, 35), (200, 205, 210)),
    "brown": ((140, 95, 65), (30, 25, 20), (190, 180, 170)),
    "dark": ((90, 60, 42), (20, 18, 16), (150, 160, 150)),
}


def head(skin, hair, wall) -> np.ndarray:
    """A head with its neck above a shirt, ``(H, W, 3)``."""
    image = np.full((H, W, 3), wall, np.float32)
    y, x = np.mgrid[:H, :W]

    def ellipse(centre, axes, colour, shade=0.0):
        mask = np.zeros((H, W), np.uint8)
        cv2.ellipse(mask, centre, axes, 0, 0, 360, 1, -1)
        u = (x - centre[0] + 0.3 * axes[0]) / axes[0]
        v = (y - centre[1] + 0.3 * axes[1]) / axes[1]
        lit = np.asarray(colour) * (1 - shade * (u**2 + v**2))[..., None]
        image[mask > 0] = lit[mask > 0]

    skin = np.asarray(skin, float)
    ellipse((160, 95), (58, 70), hair)
    image[150:205, 138:182] = 0.85 * skin
    ellipse((160, 250), (110, 60), (60, 70, 120))
    ellipse((112, 112), (8, 14), 0.9 * skin)
    ellipse((208, 112), (8, 14), 0.9 * skin)
    ellipse((160, 112), (46, 60), skin, 0.12)
    for middle in (142, 178):
        ellipse((middle, 102), (8, 4), (240, 240, 240))
        ellipse((middle, 102), (3, 4), (40, 30, 20))
        ellipse((middle, 90), (10, 2), hair)
    ellipse((160, 122), (5, 9), 0.9 * skin)
    ellipse((160, 144), (14, 4), (170, 80, 80))
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8))


def films(face: np.ndarray, n: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    noisy = (face + rng.normal(0, 2, face.shape) for _ in range(n))
    return [np.clip(image, 0, 255).astype(np.uint8) for image in noisy]


@pytest.mark.parametrize("who", PEOPLE)
def test_a_face_begins_no_track(who) -> None:
    tracker = Tracker(TrackerSettings(), CAMERA, None, default(), calibrate_hand)
    for k, image in enumerate(films(head(*PEOPLE[who]), 11)):
        tracker.step(Frame(k, k / 30, image))
        assert tracker.track is None, k


def test_a_face_is_not_followed_where_a_hand_has_left(tmp_path) -> None:
    face = head(*PEOPLE["brown"])
    path = tmp_path / "face.png"
    cv2.imwrite(str(path), np.clip(face[..., ::-1], 0, 255).astype(np.uint8))
    scene = Scene(seed=4, surface="cardboard", width_px=W, height_px=H, focal_px=300.0)
    look, motion = scene.look, scene.motion
    scene = replace(
        scene,
        look=replace(look, background=str(path)),
        motion=replace(motion, frames=12, open_frames=6),
    )
    images = [image for image, _ in frames(scene, make_actor(scene))] + films(face, 22)
    tracker = Tracker(TrackerSettings(), scene.camera, None, default(), calibrate_hand)
    status = [tracker.step(Frame(k, k / 30, image)).status for k, image in enumerate(images)]
    assert status[8:12] == [Status.TRACKED] * 4
    assert Status.TRACKED not in status[-16:]
