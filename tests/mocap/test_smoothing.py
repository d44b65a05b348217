"""The cone filter: its taps, no lag, the same duration at every rate."""

import numpy as np
import pytest

from handtrack.mocap.smoothing import cone, cone_taps, lag_frames


def test_seventeen_taps_at_120_hz_in_a_triangle():
    taps = cone_taps(120.0)
    np.testing.assert_allclose(taps * 81, [*range(1, 10), *range(8, 0, -1)])


@pytest.mark.parametrize("rate", [30.0, 50.0, 60.0, 100.0, 120.0, 240.0])
def test_same_duration_at_other_rates(rate):
    taps = cone_taps(rate)
    times = (np.arange(taps.size) - taps.size // 2) / rate
    assert np.sqrt(taps @ times**2) == pytest.approx(0.0304, abs=0.0015)


def test_a_straight_line_and_a_constant_pass():
    line = np.arange(100.0)[:, None] * [1.0, -2.0]
    np.testing.assert_allclose(cone(line, 120.0)[8:-8], line[8:-8], atol=1e-10)
    np.testing.assert_allclose(cone(np.full(50, 3.0), 120.0), 3.0)


def test_no_lag():
    t = np.arange(400) / 120
    truth = np.stack([np.sin(7 * t), np.cos(4 * t + t**2)], axis=1)
    noisy = truth + np.random.default_rng(0).normal(0, 0.1, truth.shape)
    assert lag_frames(cone(noisy, 120.0), truth) == 0
    assert lag_frames(np.roll(truth, 3, axis=0), truth) == 3


def test_unknown_stays_unknown_and_does_not_spread():
    x = np.ones((40, 2))
    x[10, 0] = np.nan
    got = cone(x, 120.0)
    assert np.isnan(got[10, 0])
    assert np.isfinite(got).sum() == 79
    np.testing.assert_allclose(got[np.isfinite(got)], 1.0)


def test_one_tap_filters_nothing():
    x = np.random.default_rng(0).normal(size=30)
    np.testing.assert_array_equal(cone(x, 120.0, taps=1), x)
