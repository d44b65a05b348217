"""The network's numbers, and that it tells a rendered hand's pose far better than a guess."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.training.lessons import lesson_from
from handtrack.proposer.network import (
    PLACED,
    Hypotheses,
    decode,
    propose,
    rotations,
    towards_ray,
)
from handtrack.proposer.picture import PALM_PER_DISC, SIDE_PX, Square, picture_of
from synth.pictures import PALM_PX, pictures
from synth.pictures import SIDE_PX as PICTURE_PX


@pytest.fixture(scope="module")
def rendered(gl):
    return list(islice(pictures(np.random.default_rng(77)), 40))


def intrinsics_of(picture):
    middle = (PICTURE_PX - 1) / 2
    return np.array([picture.focal_px, picture.focal_px, middle, middle])


def numbers(theta, R, place, spread=-3.0):
    """What a network that is sure of one hand would say."""
    axes = R[:, :2].T.ravel()
    parts = [0.0], theta, np.full(20, spread), axes, place, np.full(3, spread)
    return np.concatenate(parts)[None]


def mixture(*pairs):
    """Hypotheses of given weights and rotations, all fingers straight."""
    weight, R = zip(*pairs, strict=True)
    k = len(weight)
    return Hypotheses(
        np.array(weight), np.zeros((k, 20)), np.full((k, 20), 0.2), np.array(R), np.full(k, 0.2),
        np.zeros((k, 2)), np.ones(k), np.full(k, 40.0), np.full(k, 0.1),
    )  # fmt: skip


PALM, BACK = np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])


def test_a_lesson_and_its_decoding_undo_each_other(rendered):
    rng = np.random.default_rng(0)
    for picture in rendered[:8]:
        square = Square(picture.at_px + rng.normal(0, 3, 2), 17.0, float(rng.normal()))
        K = intrinsics_of(picture)
        back = rotation.about_z(-square.turn)
        ray = (picture.at_px - K[2:]) / K[:2]
        place = [
            *(back[:2, :2] @ (picture.at_px - square.centre_px) / 17.0),
            np.log(PALM_PX / 17.0),
        ]
        seen = decode(
            numbers(picture.theta, back @ towards_ray(ray).T @ picture.R, place), square, K
        )
        np.testing.assert_allclose(seen.R[0], picture.R, atol=1e-9)
        np.testing.assert_allclose(seen.at_px[0], picture.at_px, atol=1e-9)
        np.testing.assert_allclose(seen.palm_px[0], PALM_PX)


def test_lessons_hold_the_truth_of_their_picture(rendered):
    rng = np.random.default_rng(1)
    for picture in rendered[:8]:
        lesson = lesson_from(picture, rng)
        assert lesson.seen.shape == (2, SIDE_PX, SIDE_PX)
        assert set(np.unique(lesson.seen[0] > 0.5)) == {False, True}
        np.testing.assert_allclose(lesson.theta, picture.theta, atol=1e-6)
        # whatever the square, the palm's slant to the line of sight is the same
        ray = (picture.at_px - (PICTURE_PX - 1) / 2) / picture.focal_px
        ahead = np.array([*ray, 1.0]) / np.sqrt(ray @ ray + 1)
        assert lesson.R[2, 2] == pytest.approx(ahead @ picture.R[:, 2], abs=1e-5)


def test_neither_exposure_nor_scenery_is_in_the_picture(rendered):
    shaded = max(rendered, key=lambda picture: picture.grey[picture.alpha > 128].std())
    grey = np.asarray(shaded.grey, float)
    mask = shaded.alpha > 128
    square = Square(shaded.at_px, 17.0)
    darker = np.where(mask, 0.5 * grey + 10, 200)
    with_scenery = np.where(mask, grey, 33)
    a, b = picture_of(with_scenery, mask, square), picture_of(darker, mask, square)
    assert np.abs(a - b).max() < 0.3  # only what keeps even skin even
    np.testing.assert_array_equal(a[0], b[0])


def test_rotations_keep_what_is_one():
    R = rotation.exp(np.random.default_rng(2).normal(size=(5, 3)))
    axes = np.concatenate([R[:, :, 0], R[:, :, 1]], axis=1)
    np.testing.assert_allclose(rotations(axes * 3.0), R, atol=1e-12)


def test_drawn_hands_lie_where_they_were_seen():
    K = np.array([600.0, 600.0, 320.0, 240.0])
    seen = decode(
        numbers(np.zeros(20), PALM, [0.3, -0.2, 0.8], -20.0),
        Square(np.array([400.0, 200.0]), 50.0),
        K,
    )
    _, R, t = seen.draw(200, K, 90.0, np.random.default_rng(0))
    at = t + PLACED * 90.0 * R[:, :, 1]
    px = at[:, :2] / at[:, 2:] * K[:2] + K[2:]
    assert np.abs(px - seen.at_px[0]).mean() < 0.06 * 50
    assert np.median(K[0] * 90.0 / at[:, 2]) == pytest.approx(50 * np.exp(0.8), rel=0.02)


def test_a_mixture_knows_its_sides_and_its_density():
    both = mixture((0.7, PALM), (0.3, BACK))
    assert both.facing(("back",)).weight.tolist() == [1.0]
    assert mixture((1.0, PALM)).facing(("back",)) is None
    assert both.log_density(np.zeros(20), PALM) > both.log_density(np.zeros(20), BACK)
    assert both.log_density(np.zeros(20), PALM) > both.log_density(np.full(20, 0.3), PALM)
    joined = Hypotheses.joined([both, mixture((1.0, BACK))])
    np.testing.assert_allclose(joined.weight, [0.35, 0.15, 0.5])


def test_a_palm_that_no_hypothesis_is_near_is_told_nothing():
    """And not, of weights that vanish, a flat hand for sure."""
    bent = replace(mixture((1.0, PALM)), theta=np.full((1, 20), 0.8))
    assert bent.near(BACK) is None
    mean, std, normal = bent.near(PALM)
    np.testing.assert_allclose(normal, PALM[:, 2], atol=1e-9)
    np.testing.assert_allclose(mean, 0.8)
    np.testing.assert_allclose(std, 0.2, rtol=1e-4)


def test_hands_that_it_has_not_seen_are_told_far_better_than_guessed(rendered):
    """Of the middle of all poses the fingers are 25 deg away and the palm 40."""
    fingers, palms, sides = [], [], []
    for picture in rendered:
        grey = np.minimum(picture.grey * (255.0 / np.maximum(picture.alpha, 1)), 255)
        square = Square(picture.at_px, PALM_PX / PALM_PER_DISC)
        seen = propose(grey, picture.alpha > 128, square, intrinsics_of(picture))
        best = int(np.argmax(seen.weight))
        fingers.append(np.degrees(np.abs(seen.theta[best] - picture.theta).mean()))
        palms.append(np.degrees(rotation.angle_between(seen.R[best], picture.R)))
        sides.append((seen.R[best, 2, 2] < 0) == (picture.R[2, 2] < 0))
    assert np.median(fingers) < 16
    assert np.median(palms) < 20
    assert np.mean(sides) > 0.8
