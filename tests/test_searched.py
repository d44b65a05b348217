"""When a search of both sides begins a track: the sequential test, with looks that are made up."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.candidates import Candidate
from handtrack.evidence.silhouette import Segmenter
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default as default_space
from handtrack.judge import share_seen
from handtrack.records import Pose
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings
from handtrack.searched import SearchedStart, share_in_frame, solidity
from handtrack.start import Start, StartSettings

CAMERA = Camera.assumed_for(64, 48)
IMAGE = np.zeros((48, 64, 3), np.uint8)
SETTINGS = StartSettings()


class MadeUp(SearchedStart):
    """Looks that find ``(overlap, energy)`` of each side, the same in every frame."""

    def __init__(self, right=None, left=None, side="auto", seen=0.6, by_shape=False) -> None:
        super().__init__(lambda shape: None, HandShape.default(), side, "palm", SETTINGS)
        self.made_up = {"right": right, "left": left}
        self.seen, self.by_shape, self.looks = seen, by_shape, 0

    def _found(self, image, camera, rng, candidates, side):
        if (found := self.made_up[side]) is None:
            return {}
        self.looks += 1
        overlap, energy = found
        estimate = Estimate(Pose(np.eye(3), np.zeros(3)), np.zeros(20), np.ones(20))
        estimate = replace(estimate, energy=energy)
        segmenter = Segmenter(None, by_shape=self.by_shape)
        return {0: Start(self.shape, estimate, side, segmenter, overlap, 0.0, self.seen)}


def first(search: SearchedStart, frames: int = 40) -> tuple[int, str] | None:
    """The frame in which a track begins, and as which side."""
    rng = np.random.default_rng(0)
    for k in range(frames):
        if (start := search(IMAGE, tuple, CAMERA, rng)) is not None:
            return k, start.side
    return None


class SeveralPlaces(MadeUp):
    """Candidates in places side by side, each with what is found there as either side."""

    def __init__(self, *places, side) -> None:
        super().__init__(side=side)
        self.places = places
        strips = np.split(np.arange(IMAGE.shape[1]), len(places))
        masks = [np.isin(np.arange(IMAGE.shape[1]), strip) for strip in strips]
        self.candidates = [
            Candidate(np.broadcast_to(mask, IMAGE.shape[:2]).copy(), 0.9 - 0.1 * k, "shape")
            for k, mask in enumerate(masks)
        ]

    def _found(self, image, camera, rng, candidates, side):
        starts = {}
        for k, candidate in enumerate(candidates):
            self.made_up = self.places[self.candidates.index(candidate)]
            if found := super()._found(image, camera, rng, [candidate], side):
                starts[k] = found[0]
        return starts


RIGHT_HAND = {"right": (0.95, 30.0), "left": (0.93, 90.0)}
LEFT_HAND = {"right": (0.86, 95.0), "left": (0.91, 60.0)}


@pytest.mark.parametrize("side", ["right", "left"])
def test_of_two_hands_the_one_that_is_told_begins(side):
    """Though the other hand fits better, even as the side that is told."""
    for places in ((RIGHT_HAND, LEFT_HAND), (LEFT_HAND, RIGHT_HAND)):
        search = SeveralPlaces(*places, side=side)
        start = search(IMAGE, lambda s=search: s.candidates, CAMERA, np.random.default_rng(0))
        assert start is not None
        wanted = RIGHT_HAND if side == "right" else LEFT_HAND
        assert start.overlap == wanted[side][0]


def test_the_other_hand_alone_among_silhouettes_is_waited_for_and_then_believed():
    """One that looks like the other hand may be the one that is told: patience has an end."""
    search = SeveralPlaces(RIGHT_HAND, {"right": None, "left": None}, side="left")
    rng = np.random.default_rng(0)
    begun = [k for k in range(60) if search(IMAGE, lambda: search.candidates, CAMERA, rng)]
    assert begun[0] == SETTINGS.patience


def test_a_hand_that_is_alone_begins_at_once_as_the_side_that_is_told():
    search = SeveralPlaces(RIGHT_HAND, side="left")
    start = search(IMAGE, lambda: search.candidates, CAMERA, np.random.default_rng(0))
    assert start is not None
    assert start.side == "left"


def test_a_clear_side_begins_at_once():
    assert first(MadeUp(right=(0.95, 50.0), left=(0.91, 80.0))) == (0, "right")
    assert first(MadeUp(right=(0.91, 80.0), left=(0.95, 50.0))) == (0, "left")
    assert first(MadeUp(left=(0.95, 50.0), side="left")) == (0, "left")


def test_a_small_lead_adds_up_from_look_to_look():
    found = first(MadeUp(right=(0.935, 50.0), left=(0.92, 58.0)))
    assert found == (SETTINGS.look_every, "right")


def test_an_unsure_answer_comes_when_patience_ends():
    found = first(MadeUp(right=(0.930, 50.0), left=(0.930, 50.5)))
    assert found is not None
    assert found[0] <= SETTINGS.patience
    assert found[1] == "right"


def test_patience_begins_when_something_fits():
    """A hand that comes late is looked at as closely as one that was there at once."""
    search = MadeUp()
    assert first(search, frames=60) is None
    search.made_up = {"right": (0.930, 50.0), "left": (0.930, 50.5)}
    found = first(search)
    assert found is not None
    assert found[0] > SETTINGS.look_every


@pytest.mark.parametrize("poor", [None, (SETTINGS.min_overlap - 0.01, 10.0)])
def test_what_does_not_fit_begins_nothing(poor):
    assert first(MadeUp(right=poor, left=poor)) is None
    assert first(MadeUp(right=poor, side="right")) is None


def test_a_hand_that_the_shape_cue_sees_may_overlap_less():
    fair = (SETTINGS.min_overlap - 0.01, 10.0)
    assert first(MadeUp(right=fair, seen=SETTINGS.seen)) == (0, "right")
    poor = (SETTINGS.min_overlap_seen - 0.01, 10.0)
    assert first(MadeUp(right=poor, seen=1.0)) is None


def test_an_outline_by_the_shape_cue_begins_nothing_that_the_cue_is_not_sure_of():
    good = (0.95, 10.0)
    assert first(MadeUp(right=good, seen=SETTINGS.seen - 0.01)) == (0, "right")
    assert first(MadeUp(right=good, seen=SETTINGS.seen - 0.01, by_shape=True)) is None
    assert first(MadeUp(right=good, seen=SETTINGS.seen, by_shape=True)) == (0, "right")


def test_share_seen_is_the_mean_probability_inside():
    log_odds = np.zeros((24, 32), np.float32)
    log_odds[:, 16:] = 50.0
    hand = np.zeros((48, 64), bool)
    assert share_seen(log_odds, hand) == 0.0
    hand[:, 48:] = True
    assert share_seen(log_odds, hand) == pytest.approx(1.0)
    hand[:, 16:] = True
    assert share_seen(log_odds, hand) == pytest.approx((0.5 * 8 + 16) / 24)


def test_looks_are_made_now_and_then():
    search = MadeUp(right=(0.5, 50.0), side="right")
    first(search, frames=2 * SETTINGS.look_every)
    assert search.looks == 2


def test_solidity_of_nothing_is_one():
    assert solidity(np.zeros((5, 5), bool)) == 1.0


def test_a_hand_whose_fingers_leave_the_frame_is_no_start():
    method = RefinedMethod(HandShape.default(), default_space(), RefinedSettings())
    nothing = np.zeros((48, 64), np.float32)
    view = View(
        contour=np.empty((0, 2)), normal=np.empty((0, 2)), inner=np.empty((0, 5)), sdf=nothing,
        edge_strength=nothing, edge_x=nothing, edge_y=nothing,
        intrinsics=np.array([100.0, 100.0, 32.0, 24.0]), valid=np.array([0.0, 0.0, 64.0, 48.0]),
        grey=nothing.astype(np.uint8),
    )  # fmt: skip
    upright = np.diag([1.0, -1.0, -1.0])

    def share(y_mm: float) -> float:
        pose = Pose(upright, np.array([0.0, y_mm, 500.0]))
        return share_in_frame(method, Estimate(pose, np.zeros(20), np.ones(20)), view)

    assert share(90.0) == 1.0
    assert share(-40.0) < SETTINGS.min_in_frame < 1.0
    assert share(-400.0) == 0.0
