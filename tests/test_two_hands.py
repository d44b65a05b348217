"""Two hands in the picture: the one that is told is followed, and a lost one is not the other."""

from functools import cache

import numpy as np
import pytest

from calib.hand import calibrate_hand
from handtrack.camera import Camera
from handtrack.hand.space import default
from handtrack.records import Frame, Status
from handtrack.tracker import Tracker, TrackerSettings
from synth.actor import make_actor
from synth.clip import frames
from synth.scene import Look, Motion, Scene

W, H = 320, 240


@cache
def film(side: str) -> list[np.ndarray]:
    """A hand before a wall: an open palm if it is a right one, else bent fingers."""
    scene = Scene(
        seed=7, surface="cardboard", side=side, width_px=W, height_px=H, focal_px=300.0,
        look=Look(noise=2), motion=Motion(frames=14, open_frames=20 if side == "right" else 0),
    )  # fmt: skip
    return [image for image, _ in frames(scene, make_actor(scene))]


def wall() -> np.ndarray:
    """The same wall without hands."""
    colour = np.median(film("right")[0][:8].reshape(-1, 3), axis=0)
    noise = np.random.default_rng(0).normal(0, 2, (H, 2 * W, 3))
    return np.clip(colour + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_hand_that_is_told_is_followed_and_found_again(side) -> None:
    """Though the open palm of the other would do as its back."""
    both = [np.hstack(pair) for pair in zip(film("right"), film("left"), strict=True)]
    images = both + [wall() for _ in range(20)] + both
    camera = Camera(300.0, 300.0, W - 0.5, H / 2 - 0.5, 2 * W, H)
    tracker = Tracker(TrackerSettings(side=side), camera, None, default(), calibrate_hand)
    results = [tracker.step(Frame(k, k / 30, image)) for k, image in enumerate(images)]
    status = [result.status for result in results]
    assert Status.TRACKED not in status[len(both) + 4 : len(both) + 20]
    for k in (len(both) - 1, len(images) - 1):
        assert status[k] is Status.TRACKED
        x = results[k].keypoints_px[:, 0]
        assert (x < W).all() if side == "right" else (x > W).all()
