"""Single pictures: the hand is where the truth says, of skin and of cardboard."""

from itertools import islice

import numpy as np
import pytest

import synth.pictures
from synth.pictures import PALM_PX, SIDE_PX, pictures


@pytest.mark.parametrize("of_cardboard", [False, True])
def test_the_palm_is_where_the_truth_says(gl, monkeypatch, of_cardboard):
    monkeypatch.setattr(synth.pictures, "CARDBOARD", float(of_cardboard))
    shown = list(islice(pictures(np.random.default_rng(1)), 30))
    hit, widths = [], []
    for picture in shown:
        x, y = picture.at_px.round().astype(int)
        hit.append(picture.alpha[y, x] > 128)
        across = abs(picture.R[2, 2])  # how frontal the palm is
        if across > 0.8:
            widths.append(np.sqrt((picture.alpha > 128).sum()) / PALM_PX)
        assert picture.alpha.shape == picture.grey.shape == (SIDE_PX, SIDE_PX)
        assert (picture.grey[picture.alpha == 0] == 0).all()
    assert np.mean(hit) > 0.9  # the axis is inside the palm
    assert 1.0 < np.median(widths) < 2.5  # a hand is a few palms large


def test_a_seed_says_it_all(gl):
    one, same, other = (next(pictures(np.random.default_rng(s))) for s in (4, 4, 5))
    np.testing.assert_array_equal(one.grey, same.grey)
    np.testing.assert_array_equal(one.theta, same.theta)
    assert not np.array_equal(one.theta, other.theta)
