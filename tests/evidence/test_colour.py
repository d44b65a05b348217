import numpy as np
import pytest

from handtrack.evidence.colour import ColourModel, histogram

SKIN, WALL, SLEEVE = (205, 150, 128), (120, 125, 130), (40, 60, 140)


def samples(colour, n=2000, spread=6, seed=0):
    noise = np.random.default_rng(seed).normal(0, spread, (n, 3))
    return np.clip(np.array(colour) + noise, 0, 255).astype(np.uint8)


def test_histogram_is_a_density_and_sits_at_its_colour():
    h = histogram(samples((128, 128, 128), spread=0), shades=np.array([[1.0, 1.0]]))
    assert h.sum() == pytest.approx(1, abs=1e-5)
    centre = [
        np.average(np.arange(32), weights=h.sum(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))
    ]
    assert centre == pytest.approx([128 / 255 * 31, 15.5, 15.5], abs=0.05)


def test_shades_follow_their_surface():
    model = ColourModel.from_samples(samples(SKIN), samples(WALL))
    for factor in (1.0, 0.8, 0.65):
        hand = (samples(SKIN, seed=1) * factor).astype(np.uint8)
        wall = (samples(WALL, seed=2) * factor).astype(np.uint8)
        assert np.mean(model.log_odds(hand) > 0) > 0.97
        assert np.mean(model.log_odds(wall) < 0) > 0.97


def test_colours_never_seen_lean_to_background():
    model = ColourModel.from_samples(samples(SKIN), samples(WALL))
    assert model.log_odds(np.array([[0, 255, 0]], np.uint8))[0] < 0


def test_follows_a_change_of_light():
    model = ColourModel.from_samples(samples(SKIN), samples(WALL))
    warmer = samples((225, 150, 105), seed=3)
    before = model.log_odds(warmer).mean()
    for _ in range(60):
        model.learn(warmer, samples(WALL), rate=0.1)
    assert model.log_odds(warmer).mean() > before + 1


def test_a_change_of_the_light_is_taken_back():
    model = ColourModel.from_samples(samples(SKIN), samples(WALL))
    light = np.array([0.75, 1.0, 1.35])
    hand, wall = ((samples(c, seed=4) * light).clip(0, 255).astype(np.uint8) for c in (SKIN, WALL))
    assert np.mean(model.log_odds(hand) > 0) < 0.5
    model.relight(light)
    assert np.mean(model.log_odds(hand) > 0) > 0.97
    assert np.mean(model.log_odds(wall) < 0) > 0.97


def test_wrong_masks_for_minutes_do_not_turn_it_round():
    model = ColourModel.from_samples(samples(SKIN), np.vstack([samples(WALL), samples(SLEEVE)]))
    for k in range(300):  # hand and background swapped, and the sleeve called hand
        wrong = np.vstack([samples(WALL, 500, seed=k), samples(SLEEVE, 500, seed=k)])
        model.learn(wrong, samples(SKIN, 500, seed=k), rate=0.1)
    assert np.mean(model.log_odds(samples(SKIN, seed=5)) > 0) > 0.97
    assert np.mean(model.log_odds(samples(WALL, seed=5)) < 0) > 0.97
    assert np.mean(model.log_odds(samples(SLEEVE, seed=5)) < 0) > 0.97


def test_no_pixels_have_no_odds_and_teach_nothing():
    model = ColourModel.from_samples(samples(SKIN), samples(WALL))
    before = model.table.copy()
    none = np.empty((0, 3), np.uint8)
    assert model.log_odds(none).shape == (0,)
    model.learn(none, none, 0.5)
    assert np.array_equal(model.table, before)
