"""Random search, and the paper's comparison in little: error against the number of samples."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.fingers.baselines import Condensation, RandomSearch
from handtrack.fingers.densities import Box, Gaussians
from handtrack.fingers.filter import Filter, FilterSettings, ParticleFilter

K = 7
BOX = Box(-2 * np.ones(K), 2 * np.ones(K))


def at(target):
    return lambda X: -8 * np.sum((X - target) ** 2, axis=1)


def test_random_search_keeps_the_best():
    rng = np.random.default_rng(0)
    target = np.full(K, 0.5)
    few, many = (RandomSearch(BOX, n).step(rng, at(target)) for n in (50, 50000))
    assert np.array_equal(many.map_X, many.X[np.argmax(many.logG)])
    assert np.linalg.norm(many.map_X - target) < 0.6 * np.linalg.norm(few.map_X - target)
    assert (np.abs(many.X) <= 2).all()


def test_random_search_about_the_last_best_improves():
    rng = np.random.default_rng(0)
    target = np.full(K, 0.5)
    search = RandomSearch(BOX, 500, sigma=np.full(K, 0.2))
    errors = [np.linalg.norm(search.step(rng, at(target)).map_X - target) for _ in range(15)]
    assert errors[-1] < 0.4 < errors[0]
    alone = RandomSearch(BOX, 500)
    errors = [np.linalg.norm(alone.step(rng, at(target)).map_X - target) for _ in range(15)]
    assert min(errors) > 0.4


def test_in_seven_dimensions_a_memory_beats_the_search():
    rng = np.random.default_rng(1)
    start = Gaussians(np.ones(1), np.zeros((1, K)), np.full(K, 0.2))
    tracker = Condensation(start, np.full(K, 0.1), 500)
    search = RandomSearch(BOX, 500)
    X, errors = np.zeros(K), {"tracker": [], "search": []}
    for _ in range(20):
        X = X + rng.normal(0, 0.1, K)
        errors["tracker"].append(np.linalg.norm(tracker.step(rng, at(X)).mean - X))
        errors["search"].append(np.linalg.norm(search.step(rng, at(X)).map_X - X))
    assert np.mean(errors["tracker"]) < 0.6 * np.mean(errors["search"])


def test_tempering_is_an_option_of_condensation():
    start = Gaussians(np.ones(1), np.zeros((1, K)), np.full(K, 0.5))
    rng = np.random.default_rng(0)
    plain = Condensation(start, np.full(K, 0.1), 200).step(rng, lambda X: 1e4 * at(0.1)(X))
    tempered = Condensation(start, np.full(K, 0.1), 200, 0.5).step(rng, lambda X: 1e4 * at(0.1)(X))
    assert plain.exponent == 1
    assert plain.ess < 5
    assert tempered.ess == pytest.approx(100, rel=0.01)


def test_all_three_are_filters():
    start = Gaussians(np.ones(1), np.zeros((1, K)), np.ones(K))

    class Model:
        def logPsi(self, X):
            return np.zeros(len(X))

        def M0(self):
            return start

        def M(self, X, W):
            return Gaussians(W, X, np.ones(K))

        def importance(self, X, W, proposals=None):
            return self.M(X, W)

    filters: list[Filter] = [
        ParticleFilter(Model(), FilterSettings(40)),
        Condensation(start, np.ones(K), 40),
        RandomSearch(BOX, 40),
    ]
    rng = np.random.default_rng(0)
    for scheme in filters:
        assert scheme.posterior is None
        for again in (False, False, True):
            posterior = scheme.step(rng, at(0.0), None, again)
        assert posterior is scheme.posterior
        assert posterior.X.shape == (40, K)
        scheme.restart()
        assert scheme.posterior is None


def test_settings_are_checked():
    with pytest.raises(InputError, match="sample"):
        RandomSearch(BOX, 0)
    with pytest.raises(InputError, match="sigma"):
        Condensation(BOX, np.zeros(K))
