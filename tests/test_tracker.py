"""The tracker on clips drawn in software: start, both sides, loss and return, determinism."""

from dataclasses import replace

import numpy as np
import pytest

from calib.hand import calibrate_hand
from handtrack import tracker as tracker_module
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default
from handtrack.records import Frame, FrameResult, Status
from handtrack.searched import SearchedStart
from handtrack.start import StartSettings
from handtrack.tracker import Tracker, TrackerSettings
from synth.actor import make_actor
from synth.clip import frames
from synth.scene import Scene


def filmed(side: str, n: int) -> tuple[list[np.ndarray], Scene]:
    """Frames of the cardboard hand, 320 by 240, beginning with an open palm."""
    scene = Scene(
        seed=3, surface="cardboard", side=side, width_px=320, height_px=240, focal_px=300.0
    )
    scene = replace(scene, motion=replace(scene.motion, frames=n, open_frames=6))
    return [image for image, _ in frames(scene, make_actor(scene))], scene


def track(images: list[np.ndarray], scene: Scene, **settings) -> tuple[list[FrameResult], Tracker]:
    tracker = Tracker(TrackerSettings(**settings), scene.camera, None, default(), calibrate_hand)
    return [tracker.step(Frame(k, k / 30, image)) for k, image in enumerate(images)], tracker


@pytest.fixture(scope="module")
def right() -> tuple[list[np.ndarray], Scene]:
    return filmed("right", 16)


@pytest.fixture(scope="module")
def tracked(right) -> tuple[list[FrameResult], Tracker]:
    return track(*right)


def test_a_doubtful_outline_counts_for_less(right, tracked, monkeypatch) -> None:
    see = tracker_module.see

    def doubted(*arguments):
        return replace(see(*arguments), decided=0.8)

    monkeypatch.setattr(tracker_module, "see", doubted)
    for sure, unsure in zip(tracked[0][:4], track(right[0][:4], right[1])[0], strict=True):
        assert (unsure.theta_std > sure.theta_std).mean() > 0.9
        assert unsure.theta_std.mean() > 1.5 * sure.theta_std.mean()
        assert np.degrees(np.abs(unsure.theta - sure.theta)).mean() < 5


def test_it_starts_by_itself_and_follows(tracked) -> None:
    results, tracker = tracked
    assert [r.status for r in results] == [Status.TRACKED] * len(results)
    assert {r.side for r in results} == {"right"}
    assert tracker.shape.calibrated
    for result in results:
        assert np.isfinite(result.theta).all()
        assert (result.theta_std > 0).all()
        np.testing.assert_allclose(result.R @ result.R.T, np.eye(3), atol=1e-9)


def test_it_follows_through_a_change_of_white_balance(right, tracked) -> None:
    images, scene = right
    light = np.array([1.35, 1.0, 0.65])
    shares = np.clip(np.arange(len(images)) / 10, 0, 1)
    turned = [
        np.clip(image * light**share, 0, 255).astype(np.uint8)
        for image, share in zip(images, shares, strict=True)
    ]
    for result, as_it_was in zip(track(turned, scene)[0], tracked[0], strict=True):
        assert result.status is Status.TRACKED
        assert np.degrees(np.abs(result.theta - as_it_was.theta)).mean() < 6


def test_the_same_seed_gives_the_same_numbers(right, tracked) -> None:
    again, _ = track(right[0][:8], right[1])
    for a, b in zip(again, tracked[0], strict=False):
        np.testing.assert_array_equal(a.theta, b.theta)
        np.testing.assert_array_equal(a.t_mm, b.t_mm)


def test_a_mirrored_clip_is_the_left_hand_with_the_same_angles(right, tracked) -> None:
    images, scene = right
    flipped = [np.ascontiguousarray(image[:, ::-1]) for image in images[:8]]
    results, _ = track(flipped, replace(scene, side="left"))
    assert {r.side for r in results} == {"left"}
    width = scene.width_px
    for left, as_right in zip(results, tracked[0], strict=False):
        assert np.degrees(np.abs(left.theta - as_right.theta)).mean() < 3.0
        apart = left.keypoints_px - (np.array([width - 1, 0]) + as_right.keypoints_px * [-1, 1])
        assert np.linalg.norm(apart, axis=1).mean() < 3.0
        assert abs(np.linalg.det(left.R) - 1) < 1e-9


def test_a_hand_that_goes_is_lost_and_found_when_it_comes_back(right) -> None:
    images, scene = right
    wall = np.median(np.stack(images), axis=0).astype(np.uint8)
    wall[:] = np.median(wall[:10].reshape(-1, 3), axis=0).astype(np.uint8)
    clip = [*images[:4], *[wall] * 20, *images[:5]]
    results, _ = track(clip, scene)
    assert results[3].status is Status.TRACKED
    assert results[23].status is Status.LOST
    assert np.isnan(results[23].theta).all()
    assert results[-1].status is Status.TRACKED


def test_a_wrong_guess_of_the_side_is_found_out(right, monkeypatch) -> None:
    """Begun as a left hand, the right palm fits best as the left hand's back: it is the other."""
    images, scene = right

    class GuessLeft(SearchedStart):
        def __init__(self, make_method, shape, side, *rest) -> None:
            super().__init__(make_method, shape, "left" if side == "auto" else side, *rest)

    monkeypatch.setattr(tracker_module, "SearchedStart", GuessLeft)
    easy = TrackerSettings(start=StartSettings(min_overlap=0.5, max_solidity=1.0))
    tracker = Tracker(easy, scene.camera, None, default(), calibrate=None)
    clip = [*images[:4], *[images[4]] * 12]
    sides = [tracker.step(Frame(k, k / 30, image)).side for k, image in enumerate(clip)]
    assert sides[0] == "left"
    assert sides[-1] == "right"


def test_a_better_open_palm_takes_the_place_of_a_poorer_one(right) -> None:
    images, scene = right
    wanted, begun = [], []

    def calibrate(mask, camera, **options):
        found = calibrate_hand(mask, camera, **options)
        if tracker.track is None:
            return replace(found, quality=0.5 * found.quality)
        begun.append(tracker.track.quality)
        wanted.append(options["min_quality"])
        return replace(found, quality=0.95)

    tracker = Tracker(TrackerSettings(), scene.camera, None, default(), calibrate)
    for k, image in enumerate(images[:12]):
        tracker.step(Frame(k, k / 30, image))
    assert tracker.track is not None
    assert tracker.track.quality == 0.95
    better = StartSettings().better_quality
    assert wanted == [begun[0] + better]  # and once it is good, no more is asked


def test_frames_that_cannot_be_decoded_are_said_to_be(right) -> None:
    images, scene = right
    tracker = Tracker(TrackerSettings(), scene.camera, None, default(), calibrate_hand)
    statuses = [
        tracker.step(Frame(k, k / 30, image)).status
        for k, image in enumerate([images[0], None, images[1]])
    ]
    assert statuses == [Status.TRACKED, Status.UNDECODABLE, Status.TRACKED]


def test_no_hand_no_answer() -> None:
    wall = np.full((240, 320, 3), 120, np.uint8)
    tracker = Tracker(
        TrackerSettings(),
        Scene(width_px=320, height_px=240).camera,
        None,
        default(),
        calibrate_hand,
    )
    result = tracker.step(Frame(0, 0.0, wall))
    assert result.status is Status.LOST
    assert np.isnan(result.theta).all()


@pytest.mark.parametrize("method", ["paper", "condensation", "random"])
def test_the_other_methods_run_on_the_same_skeleton(right, method: str) -> None:
    results, _ = track(right[0][:3], right[1], method=method, particles=50)
    assert results[0].side == "right"
    seen = [r for r in results if np.isfinite(r.theta).all()]
    assert seen
    assert all(1 <= r.ess <= 50 for r in seen)


def test_a_given_hand_is_not_calibrated_away(right) -> None:
    shape = HandShape.default()
    tracker = Tracker(TrackerSettings(), right[1].camera, shape, default(), None)
    for k, image in enumerate(right[0][:3]):
        tracker.step(Frame(k, k / 30, image))
    assert tracker.shape is shape
