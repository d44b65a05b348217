"""Landmarks of drawn hands: found, right, never on the wrong side, refused with a reason."""

import time

import numpy as np
import pytest

from calib.landmarks import (
    find_landmarks,
    is_good_start,
    search_landmarks,
    start_quality,
)
from calib.seen import Seen

N_HANDS = 40


@pytest.fixture(scope="module")
def hands(open_hand):
    return [open_hand(np.random.default_rng(seed)) for seed in range(N_HANDS)]


@pytest.fixture(scope="module")
def found(hands):
    return [find_landmarks(hand.mask) for hand in hands]


def test_open_hands_are_found(found):
    assert sum(landmarks is not None for landmarks in found) >= 0.9 * N_HANDS


def test_side_is_never_wrong(hands, found):
    for hand, landmarks in zip(hands, found, strict=True):
        mirrored = find_landmarks(hand.mask[:, ::-1])
        assert landmarks is None or landmarks.side == "right"
        assert mirrored is None or mirrored.side == "left"


def test_tips_lie_on_the_true_tips(hands, found):
    for hand, landmarks in zip(hands, found, strict=True):
        if landmarks is not None:
            off = np.linalg.norm(landmarks.tips_px - hand.keypoints_px[4::4], axis=1)
            assert off.max() < 4.0  # px of a hand of 200 px, foreshortened tips included


def test_labels_follow_the_digits(hands, found):
    """Every labelled outline point is nearer to its own digit's bones than to any other's."""
    for hand, landmarks in zip(hands, found, strict=True):
        if landmarks is None:
            continue
        labelled = landmarks.label >= 0
        points, label = landmarks.contour_px[labelled], landmarks.label[labelled]
        beyond = hand.keypoints_px[1:].reshape(5, 4, 2)[:, 1:]  # from the second joint on
        share = np.linspace(0, 1, 9)[:, None, None, None]
        samples = (1 - share) * beyond[:, :-1] + share * beyond[:, 1:]  # (9, 5, 2, 2)
        distance = np.linalg.norm(samples[..., None, :] - points, axis=-1).min(axis=(0, 2))
        near_a_finger = distance.min(axis=0) < 8.0
        wrong = (distance.argmin(axis=0) != label) & near_a_finger
        assert wrong.mean() < 0.02


def test_size_of_the_picture_does_not_matter(open_hand):
    small = open_hand(np.random.default_rng(1), height_px=100)
    large = open_hand(np.random.default_rng(1), height_px=400)
    a, b = find_landmarks(small.mask), find_landmarks(large.mask)
    ratio = large.camera.width_px / small.camera.width_px
    np.testing.assert_allclose((a.tips_px + 0.5) * ratio - 0.5, b.tips_px, atol=1.0 * ratio)
    np.testing.assert_allclose(a.reach_r, b.reach_r, rtol=0.1)


def test_a_square_corner_is_no_finger():
    sleeve = np.zeros((300, 300), bool)
    sleeve[80:220, 80:300] = True
    assert search_landmarks(sleeve) == (None, Seen.FEW_TIPS)


@pytest.mark.parametrize("mask", [np.zeros((50, 50), bool), np.eye(50, dtype=bool)])
def test_nothing_is_a_status(mask):
    landmarks, seen = search_landmarks(mask)
    assert landmarks is None
    assert seen in (Seen.NOTHING, Seen.FEW_TIPS)


def test_a_hand_cut_by_the_border_is_no_start(hands, found):
    hand, landmarks = hands[0], found[0]
    x = round(landmarks.tips_px[:, 0].max()) - 6
    y = round(landmarks.tips_px[:, 1].max()) - 6
    for cut in (hand.mask[:, :x], hand.mask[:y]):
        assert not is_good_start(find_landmarks(cut))


def test_quality_falls_when_a_finger_is_cut_short(found, hands):
    whole = found[1]
    tip, root = whole.tips_px[2], whole.valleys_px[1:3].mean(axis=0)
    yy, xx = np.indices(hands[1].mask.shape)
    beyond = (np.stack([xx, yy], axis=-1) - root) @ (tip - root) > 0.62 * np.sum((tip - root) ** 2)
    near = np.hypot(xx - tip[0], yy - tip[1]) < 0.42 * np.linalg.norm(tip - root)
    short = find_landmarks(hands[1].mask & ~(beyond & near))
    assert start_quality(whole) > 0.6
    assert short is None or start_quality(short) < start_quality(whole) - 0.2


def test_fast_enough_for_every_frame(hands):
    """Far above what it takes, so that a loaded machine passes."""
    begin = time.process_time()
    for hand in hands[:10]:
        search_landmarks(hand.mask)
    assert (time.process_time() - begin) / 10 < 0.03
