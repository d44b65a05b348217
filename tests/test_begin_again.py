"""A clip whose hand turns out to be another than it was taken for."""

import json

import pytest

from handtrack.run import RunSettings, run_clip, track
from tests.test_run import FakeTracker, listing, rows_of


class LateTracker(FakeTracker):
    """Finds out in frame 4 that the hand is not the one that it was told, unless it was."""

    def __init__(self, settings, camera):
        super().__init__(camera)
        self.settings, self.found_out = settings, None
        self.facing = settings.facing

    def step(self, frame):
        if frame.index == 4 and self.settings.side == "auto":
            self.found_out = ("left", "back")
        return super().step(frame)


@pytest.fixture
def makers():
    """What trackers were made for, and the function that makes them."""
    asked = []

    def make(settings, camera, shape):
        asked.append((settings.side, settings.facing))
        return LateTracker(settings, camera)

    return asked, make


def test_it_is_begun_again_and_nothing_is_left_of_the_first_time(
    tmp_path, write_clip, makers, capsys
):
    asked, make = makers
    clip, out = write_clip(tmp_path / "clip.mp4", n=8), tmp_path / "out"
    report = run_clip(RunSettings(clip, out), make)
    assert asked == [("auto", "auto"), ("left", "back")]
    assert report.counts.decoded == len(rows_of(out / "angles.csv")) == 8
    assert report.exit_code == 0
    assert not [name for name in listing(out) if name.startswith(".")]
    record = json.loads((out / "run.json").read_text())
    assert record["settings"]["side"] == record["settings"]["facing"] == "auto"
    assert (record["side"], record["facing"]) == ("left", "back")
    assert (
        "begins with the back of a left hand, as it turns out; once more" in capsys.readouterr().err
    )


def test_what_was_told_is_not_doubted(tmp_path, write_clip, makers):
    asked, make = makers
    clip = write_clip(tmp_path / "clip.mp4", n=6)
    run_clip(RunSettings(clip, tmp_path / "out", side="left"), make)
    assert asked == [("left", "auto")]


def test_a_trajectory_is_of_the_right_hand_too(tmp_path, write_clip, makers):
    asked, make = makers
    found = track(write_clip(tmp_path / "clip.mp4", n=8), make)
    assert len(asked) == 2
    assert len(found) == 8
