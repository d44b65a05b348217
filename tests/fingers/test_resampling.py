"""Resampling is unbiased, effective sample sizes have closed forms, bisection meets its share."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.fingers.resampling import ess, log_mean, normalise, power, resample, temper

SCHEMES = ("systematic", "residual")


@pytest.mark.parametrize("scheme", SCHEMES)
def test_resampling_is_unbiased(scheme):
    rng = np.random.default_rng(0)
    W = np.array([0.05, 0.0, 0.15, 0.5, 0.3])
    n, trials = 7, 4000
    counts = np.zeros((trials, 5))
    for trial in range(trials):
        counts[trial] = np.bincount(resample(rng, W, n, scheme), minlength=5)
    error = counts.mean(axis=0) - n * W
    assert (counts.sum(axis=1) == n).all()
    assert (np.abs(error) <= 4 * counts.std(axis=0) / np.sqrt(trials) + 1e-12).all()
    assert counts[:, 1].max() == 0
    assert (np.abs(counts - n * W) < (1 if scheme == "systematic" else 5)).all()


def test_a_biased_scheme_would_be_noticed():
    """The comparison above is shown to fail: always rounding down is not unbiased."""
    W = np.array([0.05, 0.0, 0.15, 0.5, 0.3])
    assert (np.abs(np.floor(7 * W) - 7 * W) > 0.1).any()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_resampling_extremes(scheme):
    rng = np.random.default_rng(0)
    assert (resample(rng, np.array([0.0, 1.0, 0.0]), 5, scheme) == 1).all()
    assert sorted(resample(rng, np.full(4, 0.25), 4, scheme)) == [0, 1, 2, 3]
    assert len(resample(rng, np.ones(3), 0, scheme)) == 0
    assert resample(rng, np.array([2.0, 6.0]), 8000, scheme).mean() == pytest.approx(0.75)


def test_unknown_scheme():
    with pytest.raises(InputError, match="systematic or residual"):
        resample(np.random.default_rng(0), np.ones(2), 2, "stratified")


def test_effective_sample_size_has_closed_forms():
    assert ess(np.zeros(50)) == pytest.approx(50)
    assert ess(np.array([0.0, -np.inf, -np.inf])) == pytest.approx(1)
    assert ess(np.log([1.0, 1, 2])) == pytest.approx(16 / 6)
    assert ess(np.log([1.0, 1, 2]) + 1e4) == pytest.approx(16 / 6)


def test_weights_without_any_weight_are_uniform():
    assert np.allclose(normalise(np.full(4, -np.inf)), 0.25)
    assert log_mean(np.full(4, -np.inf)) == -np.inf
    assert log_mean(np.log([1.0, 3.0]) - 1e5) == pytest.approx(np.log(2) - 1e5)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.9])
@pytest.mark.parametrize("scale", [10.0, 1e3, 1e6])
def test_bisection_reaches_its_share(share, scale):
    rng = np.random.default_rng(1)
    log_w, logG = rng.normal(0, 0.5, 400), -scale * rng.chisquare(7, 400)
    beta = temper(log_w, logG, share)
    assert 0 < beta < 1
    assert ess(log_w + beta * logG) == pytest.approx(share * ess(log_w), rel=1e-3)


def test_no_tempering_where_none_is_needed():
    logG = np.linspace(0, 0.1, 30)
    assert temper(np.zeros(30), logG, 0.5) == 1.0
    assert temper(np.zeros(30), 1e4 * logG, 0.0) == 1.0
    assert temper(np.zeros(30), logG, 0.5, limit=0.25) == 0.25


def test_impossible_particles_do_not_count():
    logG = np.array([-np.inf] * 90 + [0.0] * 10)
    assert temper(np.zeros(100), logG, 0.9) == 1.0
    assert temper(np.zeros(3), np.full(3, -np.inf), 0.5) == 1.0
    assert np.array_equal(power(np.array([-np.inf, 2.0]), 0.0), [-np.inf, 0.0])
