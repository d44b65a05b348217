from itertools import islice

import numpy as np
import pytest

from handtrack.proposer.facing_cue import log_odds
from handtrack.proposer.picture import PALM_PER_DISC, Square, picture_of
from synth.pictures import PALM_PX, pictures


@pytest.fixture(scope="module")
def seen(gl):
    """Rendered hands, fingers up as in a track, and whether each shows its palm."""
    hands = [p for p in islice(pictures(np.random.default_rng(78)), 60) if abs(p.R[2, 2]) > 0.5]
    turns = [np.arctan2(p.R[0, 1], -p.R[1, 1]) for p in hands]
    squares = [
        Square(p.at_px, PALM_PX / PALM_PER_DISC, turn) for p, turn in zip(hands, turns, strict=True)
    ]
    shown = [
        picture_of(np.asarray(p.grey, float), p.alpha > 128, square)
        for p, square in zip(hands, squares, strict=True)
    ]
    return shown, np.array([p.R[2, 2] < 0 for p in hands])


@pytest.mark.parametrize(
    ("what", "most", "nearly_all"), [("palm", 0.8, 0.95), ("thumb_right", 0.9, 0.97)]
)
def test_palms_and_thumbs_are_told_and_sureness_is_earned(seen, what, most, nearly_all):
    """A right hand's thumb is to the right where the palm is shown."""
    shown, is_palm = seen
    told = np.array([getattr(log_odds(picture), what) for picture in shown])
    right = (told > 0) == is_palm
    assert right.mean() > most
    assert right[np.abs(told) > 2].mean() > nearly_all


def test_a_mirror_image_shows_the_same_side_and_the_other_hand(seen):
    for picture in seen[0][:5]:
        one, mirrored = log_odds(picture), log_odds(picture[..., ::-1].copy())
        assert one.palm == pytest.approx(mirrored.palm, abs=1e-4)
        assert one.thumb_right == pytest.approx(-mirrored.thumb_right, abs=1e-4)


def test_a_silhouette_alone_says_little_of_the_side(seen):
    told = [log_odds(np.stack([picture[0], 0 * picture[0]])).palm for picture in seen[0]]
    assert np.abs(told).max() < 2.5
