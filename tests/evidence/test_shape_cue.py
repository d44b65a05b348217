from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from handtrack.camera import Camera, Window
from handtrack.evidence import shape_cue
from handtrack.evidence.candidates import find_candidates, skin_log_odds
from handtrack.evidence.evidence import see, window_around
from handtrack.evidence.silhouette import Segmenter, seen_by_shape
from handtrack.evidence.worth import worth_of


def overlap(a, b):
    return (a & b).sum() / max((a | b).sum(), 1)


@pytest.mark.parametrize("tone", ["pale", "brown", "dark", "blue"])
@pytest.mark.parametrize("ground", ["wood", "clutter", "gradient"])
def test_a_hand_is_seen_whatever_its_colour(drawing, tone, ground):
    place = getattr(drawing, ground)((120, 160))
    drawn = drawing.draw(place, drawing.SKIN[tone], drawing.spread(), scale=0.45)
    assert overlap(shape_cue.log_odds(drawn.image) > 0, drawn.mask) > 0.5


def test_a_hand_is_seen_that_has_the_colour_of_the_wood_behind_it(drawing):
    wood = drawing.wood((120, 160), (150, 104, 74))
    drawn = drawing.draw(wood, (150, 104, 74), drawing.spread(), scale=0.45)
    assert overlap(skin_log_odds(drawn.image) > 0, drawn.mask) < 0.3
    assert overlap(shape_cue.log_odds(drawn.image) > 0, drawn.mask) > 0.6


@pytest.mark.parametrize("ground", ["plain", "gradient", "wood", "clutter"])
def test_no_hand_is_seen_where_there_is_none(drawing, ground):
    place = getattr(drawing, ground)((120, 160)).astype(np.uint8)
    assert (shape_cue.log_odds(place) > 0).mean() < 0.02


def test_any_size_of_picture_gets_an_answer_of_its_size():
    rng = np.random.default_rng(0)
    for size in ((1, 1), (31, 33), (240, 135), (64, 64)):
        answer = shape_cue.log_odds(rng.integers(0, 256, (*size, 3), dtype=np.uint8))
        assert answer.shape == size
        assert np.isfinite(answer).all()


def test_a_mirrored_answer_lies_where_the_hand_is(drawing):
    """It is that of the mirror image, turned back, and it is another."""
    wood = drawing.wood((120, 160), (150, 104, 74))
    drawn = drawing.draw(wood, (150, 104, 74), drawing.spread(), scale=0.45)
    size = (160, 120)
    mirrored = shape_cue.log_odds_sized(drawn.image, size, mirrored=True)
    assert overlap(mirrored > 0, drawn.mask) > 0.6
    turned = np.ascontiguousarray(drawn.image[:, ::-1])
    np.testing.assert_array_equal(mirrored[:, ::-1], shape_cue.log_odds_sized(turned, size))
    assert not np.array_equal(mirrored, shape_cue.log_odds_sized(drawn.image, size))


def test_threads_that_ask_at_once_get_their_own_answers():
    rng = np.random.default_rng(0)
    asked = [rng.integers(0, 256, (64, 64, 3), dtype=np.uint8) for _ in range(8)]
    alone = [shape_cue.log_odds(picture) for picture in asked]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(shape_cue.log_odds, asked))
    np.testing.assert_array_equal(together, alone)


def test_colours_that_cannot_tell_are_helped_and_others_are_not(drawing):
    wood = drawing.wood(colour=(150, 104, 74))
    for place, alike in ((wood, True), (drawing.plain(), False)):
        drawn = drawing.draw(place, (150, 104, 74), drawing.spread())
        segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
        assert segmenter.by_shape == alike
        mirrored = segmenter.mirrored()
        assert (mirrored.by_shape, mirrored.worth) == (alike, segmenter.worth)


TONE = (214, 164, 134)


def before_a_face(drawing):
    """A hand before an oval of its own colour, and where the two are."""
    place = drawing.plain()
    y, x = np.mgrid[: place.shape[0], : place.shape[1]]
    off = ((x - 200) / 75) ** 2 + ((y - 130) / 100) ** 2
    face = off < 1
    place[face] = np.array(TONE) * (1 - 0.3 * off[face, None])
    drawn = drawing.draw(place, TONE, drawing.spread())
    return drawn, drawn.mask | face


def test_colours_that_have_swallowed_a_face_are_helped(drawing):
    drawn, both = before_a_face(drawing)
    assert Segmenter.from_mask(drawn.image, both).by_shape


def test_so_are_those_that_swallow_one_later(drawing):
    first = drawing.draw(drawing.plain(), TONE, drawing.spread())
    segmenter = Segmenter.from_mask(first.image, first.mask)
    whole = Window(0.0, 0.0, 1.0, *first.image.shape[1::-1])
    segmenter.reconsider(first.image, first.mask, seen_by_shape(first.image), whole)
    assert (segmenter.by_shape, segmenter.worth) == (False, 1.0)
    drawn, both = before_a_face(drawing)
    odds, face = segmenter.log_odds(drawn.image, whole), both & ~drawn.mask
    assert (odds[face] > 0).mean() > 0.9
    segmenter.reconsider(drawn.image, odds > 0, seen_by_shape(drawn.image), whole)
    assert segmenter.by_shape
    assert segmenter.worth < 0.5
    helped = segmenter.log_odds(drawn.image, whole)
    assert helped[face].mean() < 0.3 * odds[face].mean()
    assert (helped[drawn.mask] > 0).mean() > 0.95


def test_colours_are_worth_what_they_are_right_about():
    shape = np.tile([20.0, -20.0], 500)
    for wrong in (0.1, 0.3):  # of the pixels, and colours are as sure of these as of the others
        odds = 4.0 * np.sign(shape)
        odds[: int(wrong * 1000)] *= -1
        assert worth_of(odds, shape) == pytest.approx(np.log((1 - wrong) / wrong) / 4, abs=1e-4)
    assert worth_of(shape, shape) > 0.99
    assert worth_of(-shape, shape) < 0.01


def test_the_outline_of_a_hand_before_its_own_colour_is_nearer_with_the_cue(drawing):
    drawn = drawing.draw(drawing.wood(colour=(150, 104, 74)), (150, 104, 74), drawing.spread())
    segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
    window = window_around(drawn.mask)
    camera = Camera.assumed_for(640, 480)

    def nearness():
        evidence = see(drawn.image, window, camera, segmenter)
        y, x = np.nonzero(evidence.mask)
        x, y = np.rint(window.to_frame(np.column_stack([x, y]))).astype(int).T
        seen = np.zeros_like(drawn.mask)
        seen[y.clip(0, 479), x.clip(0, 639)] = True
        return overlap(seen, drawn.mask)

    helped = nearness()
    segmenter.by_shape = False
    assert helped > nearness()


def test_the_cue_brings_such_a_hand_to_the_first_candidates(drawing, monkeypatch):
    drawn = drawing.draw(drawing.wood(colour=(150, 104, 74)), (150, 104, 74), drawing.spread())

    def best_of_two():
        return max(overlap(c.mask, drawn.mask) for c in find_candidates(drawn.image)[:2])

    seen = best_of_two()
    monkeypatch.setattr(shape_cue, "log_odds", lambda rgb: np.zeros(rgb.shape[:2], np.float32))
    assert seen > 0.55
    assert best_of_two() < 0.1
