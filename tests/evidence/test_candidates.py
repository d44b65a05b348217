import numpy as np
import pytest

from handtrack.evidence import shape_cue
from handtrack.evidence.background import Background
from handtrack.evidence.candidates import find_candidates, one_coloured
from handtrack.evidence.silhouette import Segmenter


def overlap(a, b):
    return (a & b).sum() / max((a | b).sum(), 1)


def best(found, mask):
    return max((overlap(c.mask, mask) for c in found), default=0.0)


@pytest.mark.parametrize("tone", ["pale", "light", "brown", "dark", "blue", "green"])
@pytest.mark.parametrize("wall", ["plain", "gradient"])
def test_first_two_candidates_have_the_hand_before_a_wall(drawing, tone, wall):
    place = getattr(drawing, wall)((240, 320))
    drawn = drawing.draw(
        place, drawing.SKIN[tone], drawing.spread(), scale=0.95, turn=(0.2, 0, 0.4)
    )
    assert best(Segmenter.bootstrap(drawn.image)[:2], drawn.mask) > 0.9


def test_grey_hand_before_a_white_wall(drawing):
    place = drawing.plain((240, 320), (235, 236, 238))
    drawn = drawing.draw(place, drawing.SKIN["grey"], drawing.curled([0, 1, 2, 3, 4]), scale=0.95)
    assert overlap(Segmenter.bootstrap(drawn.image)[0].mask, drawn.mask) > 0.9


@pytest.mark.parametrize("tone", ["pale", "dark", "green"])
def test_hand_is_among_the_candidates_before_wood(drawing, tone):
    place = drawing.wood((240, 320))
    drawn = drawing.draw(place, drawing.SKIN[tone], drawing.curled([2, 3]), scale=0.95)
    assert best(Segmenter.bootstrap(drawn.image), drawn.mask) > 0.8


def test_motion_finds_what_colour_cannot(drawing, monkeypatch):
    """A hand of the colour of the things about it, before a background that was seen alone.

    The shape cue, which would find it too, is blind here.
    """
    monkeypatch.setattr(shape_cue, "log_odds", lambda rgb: np.zeros(rgb.shape[:2], np.float32))
    place = drawing.clutter((240, 320), seed=2)
    drawn = drawing.draw(
        place, drawing.SKIN["brown"], drawing.spread(), scale=0.95, turn=(0, 0, 0.3)
    )
    background = Background()
    for k in range(6):
        noise = np.random.default_rng(k).normal(0, 2, place.shape)
        background.watch(np.clip(place + noise, 0, 255).astype(np.uint8))
    alone = best(Segmenter.bootstrap(drawn.image), drawn.mask)
    known = best(Segmenter.bootstrap(drawn.image, background), drawn.mask)
    assert known > 0.85
    assert known > alone


def test_candidates_are_ordered_distinct_and_read_only(drawing):
    drawn = drawing.draw(drawing.clutter((240, 320)), drawing.SKIN["light"], scale=0.95)
    found = Segmenter.bootstrap(drawn.image)
    assert [c.score for c in found] == sorted((c.score for c in found), reverse=True)
    assert all(c.mask.shape == (240, 320) and not c.mask.flags.writeable for c in found)
    pairs = [(a, b) for i, a in enumerate(found) for b in found[:i]]
    of_its_own = {found[i] for i in range(1, len(found)) if found[i].cue == "pure"}
    others = [(a, b) for a, b in pairs if not (a in of_its_own and a.score == b.score)]
    assert all(overlap(a.mask, b.mask) < 0.93 for a, b in others)
    assert all(overlap(a.mask, b.mask) < 0.99 for a, b in pairs)


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (16, 16), (240, 320)])
def test_nothing_to_see(size):
    assert Segmenter.bootstrap(np.full((*size, 3), 128, np.uint8)) == []


def test_a_hand_that_was_learned_is_found_again(drawing):
    place = drawing.wood((240, 320))
    first = drawing.draw(
        place, drawing.SKIN["light"], drawing.spread(), scale=0.8, centre=(90, 120)
    )
    again = drawing.draw(
        place, drawing.SKIN["light"], drawing.curled([2]), scale=0.9, centre=(210, 130)
    )
    segmenter = Segmenter.from_mask(first.image, first.mask)
    found = segmenter.find(again.image)
    assert overlap(found[0].mask, again.mask) > 0.85
    assert found[0].cue == "learned"
    assert segmenter.find(place.astype(np.uint8)) == []


def test_a_pink_thing_that_touches_the_hand_is_left_out():
    picture = np.full((120, 160, 3), (60, 80, 160), np.uint8)
    hand, stick = np.zeros((2, 120, 160), bool)
    hand[30:100, 50:110] = True
    stick[10:40, 105:118] = True
    picture[stick] = (235, 130, 200)
    shade = np.linspace(0.5, 1.0, 120)[:, None, None]  # a hand half in the shade stays whole
    skin = shade * np.ones((120, 160, 1)) * (230, 165, 140)
    picture[hand] = skin[hand].astype(np.uint8)
    pure = one_coloured(picture, hand | stick)
    assert pure[hand].mean() > 0.9  # less a rim
    assert pure[stick & ~hand].mean() < 0.1
    assert best(find_candidates(picture), hand) > 0.95
