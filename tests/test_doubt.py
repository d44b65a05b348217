"""When a hand in track is looked for anew, and what convinces."""

from types import SimpleNamespace

import numpy as np
import pytest

from handtrack import doubt, rotation
from handtrack.estimate import Estimate
from handtrack.judge import JudgeSettings
from handtrack.records import Pose

JUDGE = JudgeSettings()
FRONT = np.diag([1.0, -1.0, -1.0])


def hand(turn_deg: float = 0.0, energy: float = 50.0) -> Estimate:
    R = rotation.about_x(np.radians(turn_deg)) @ FRONT
    pose = Pose(R, np.array([0.0, 40.0, 400.0]))
    return Estimate(pose, np.zeros(20), np.full(20, 0.1), energy=energy)


def track(**state: object) -> SimpleNamespace:
    """A track with nothing to doubt, but for ``state``."""
    usual = {"votes": 0, "side_looks": 0, "young": 0, "doubts": 0, "in_vain": 0, "excused": 50.0}
    usual |= {"voted_lost": False, "estimate": hand()}
    searcher = SimpleNamespace(energy=lambda view, estimate: estimate.energy)
    strained = state.pop("strained", False)
    return SimpleNamespace(
        **{**usual, **state}, searcher=searcher, strains=lambda estimate, factor: strained
    )


def frames_to_look(followed: SimpleNamespace, agreement: float = 0.97) -> int:
    """After how many frames the next look is due."""
    for frame in range(1, 200):
        if doubt.is_due(followed, hand(), agreement, JUDGE, "palm"):
            return frame
    raise AssertionError("never")


@pytest.mark.parametrize(
    ("state", "agreement", "frames"),
    [
        ({}, 0.97, JUDGE.check_every),
        ({"strained": True}, 0.97, JUDGE.doubt_every),
        ({"strained": True, "in_vain": 1}, 0.97, 2 * JUDGE.doubt_every),
        ({"young": 3}, 0.97, JUDGE.young_every),
        ({"young": 3, "in_vain": 1}, 0.97, 2 * JUDGE.young_every),
        ({"strained": True, "in_vain": 9}, 0.97, JUDGE.check_every),
        ({"in_vain": 9}, JUDGE.doubted_overlap - 0.01, JUDGE.doubt_every),
        ({"votes": 1, "in_vain": 9}, 0.97, JUDGE.doubt_every),
    ],
)
def test_a_look_in_vain_is_not_repeated_soon_unless_the_fit_is_poor(state, agreement, frames):
    assert frames_to_look(track(**state), agreement) == frames


def test_looks_in_vain_while_all_is_well_do_not_put_off_the_first_doubt():
    followed = track(in_vain=4)
    assert not doubt.is_due(followed, hand(), 0.97, JUDGE, "palm")
    followed.strains = lambda estimate, factor: True
    assert frames_to_look(followed) == JUDGE.doubt_every - 1  # of which one has passed


@pytest.mark.parametrize(("share", "renewed"), [(1.01, True), (0.99, False)])
def test_a_fit_that_has_become_worse_since_a_look_in_vain_is_looked_at_soon(share, renewed):
    followed = track(strained=True, in_vain=2, excused=50.0 / (JUDGE.worse * share))
    assert frames_to_look(followed) == JUDGE.doubt_every * (1 if renewed else 4)


@pytest.mark.parametrize(
    ("turn_deg", "saved", "convinced"),
    [
        (0.0, JUDGE.cheaper_by + 1, True),
        (0.0, JUDGE.cheaper_by - 1, False),
        (40.0, JUDGE.cheaper_by + 1, False),
        (40.0, JUDGE.cheaper_by + JUDGE.jump_cost + 1, True),
    ],
)
def test_a_palm_that_jumps_must_save_more(monkeypatch, turn_deg, saved, convinced):
    monkeypatch.setattr(doubt, "outline_seen", lambda *_: 0.5)
    followed, found = hand(energy=100.0), hand(turn_deg, energy=100.0 - saved)
    question = doubt.Question(failed=False, usual="palm", cost=JUDGE.turning_cost, guessed=False)
    said = doubt._convinces(None, track(), (followed, 0.95), (found, 0.95), question, JUDGE)
    assert said is convinced


def test_a_better_silhouette_does_not_convince_where_the_energy_is_higher(monkeypatch):
    monkeypatch.setattr(doubt, "outline_seen", lambda *_: 0.5)
    question = doubt.Question(failed=False, usual="palm", cost=JUDGE.turning_cost, guessed=False)
    followed = hand(energy=50.0), 0.93
    worse, better = (hand(energy=60.0), 0.97), (hand(energy=45.0), 0.97)
    assert not doubt._convinces(None, track(), followed, worse, question, JUDGE)
    assert doubt._convinces(None, track(), followed, better, question, JUDGE)


def test_a_young_track_faces_as_hands_usually_do_and_a_guessed_side_costs_nothing():
    back = hand(180.0)
    old = doubt.Question.of(track(), back, 0.97, JUDGE, "palm")
    young = doubt.Question.of(track(young=5), back, 0.97, JUDGE, "palm")
    guess = doubt.Question.of(track(side_looks=3), back, 0.97, JUDGE, "palm")
    assert (old.failed, old.usual, old.cost) == (False, "back", JUDGE.returning_cost)
    assert (young.failed, young.usual, young.cost) == (True, "palm", JUDGE.facing_cost)
    assert (guess.guessed, guess.cost) == (True, 0.0)
