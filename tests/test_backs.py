"""The back of one hand has the outline of the other's palm: which it is shows in its fingers."""

from dataclasses import replace

import numpy as np
import pytest

from calib.hand import calibrate_hand
from handtrack.hand.space import default
from handtrack.proposer.facing_cue import LogOdds
from handtrack.records import Frame, Status
from handtrack.tracker import Tracker, TrackerSettings
from synth.actor import make_actor
from synth.clip import frames
from synth.scene import Scene


def filmed(facing: str, side: str) -> tuple[list[np.ndarray], Scene]:
    """A hand made of balls that opens and closes its fingers, 320 by 240."""
    scene = Scene(seed=4, surface="spheres", side=side, width_px=320, height_px=240, focal_px=300.0)
    scene = replace(scene, motion=replace(scene.motion, frames=30, facing=facing))
    return [image for image, _ in frames(scene, make_actor(scene))], scene


def followed(images, scene, **settings):
    """The tracker and its answers, until it finds out that it was wrong."""
    tracker = Tracker(TrackerSettings(**settings), scene.camera, None, default(), calibrate_hand)
    results = []
    for k, image in enumerate(images):
        results.append(tracker.step(Frame(k, k / 30, image)))
        if tracker.found_out is not None:
            break
    return tracker, results


@pytest.fixture(scope="module")
def back():
    return filmed("back", "left")


def test_a_left_hand_seen_from_behind_is_found_out(back) -> None:
    tracker, results = followed(*back)
    assert {r.side for r in results[:-1]} == {"right"}
    assert tracker.found_out == ("left", "back")
    assert tracker.facing == "back"
    # in the same frame it is followed as what it is
    assert (results[-1].side, results[-1].status) == ("left", Status.TRACKED)
    assert results[-1].R[2, 2] > 0


def test_a_palm_stays_what_it_is(back) -> None:
    tracker, results = followed(*filmed("palm", "left"))
    assert tracker.found_out is None
    assert {r.side for r in results} == {"left"}
    assert tracker.shown.lead > 0


@pytest.mark.parametrize("told", [{"side": "right"}, {"facing": "palm"}])
def test_what_is_told_is_not_doubted(back, told) -> None:
    tracker, results = followed(*back, **told)
    assert tracker.found_out is None
    assert {r.side for r in results} == {"right"}


@pytest.mark.parametrize(
    ("palm", "thumb", "found_out"),
    [
        (4.0, -4.0, ("right", "palm")),
        (-4.0, 4.0, ("right", "back")),
        (-4.0, -4.0, ("left", "back")),
    ],
)
def test_what_the_cue_denies_says_which_hand_it_is(monkeypatch, palm, thumb, found_out):
    """A left palm, of which palm, thumb or both are denied for as long as it is followed as one."""
    monkeypatch.setattr("handtrack.tracker.shown_log_odds", lambda *_: LogOdds(palm, thumb))
    tracker, results = followed(*filmed("palm", "left"))
    assert {r.side for r in results[:-1]} == {"left"}
    assert tracker.found_out == found_out
    assert (tracker.side, tracker.facing) == found_out
    assert tracker.shown is tracker.thumb is None  # nothing more is asked


def test_where_the_facing_is_told_the_thumb_is_still_asked(monkeypatch):
    monkeypatch.setattr("handtrack.tracker.shown_log_odds", lambda *_: LogOdds(-4.0, -4.0))
    tracker, _ = followed(*filmed("palm", "left"), facing="palm")
    assert tracker.found_out == ("right", "palm")
