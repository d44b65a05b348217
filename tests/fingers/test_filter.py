"""The filter against a Kalman filter, which is exact on a linear-Gaussian problem."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.fingers.baselines import Condensation, RandomSearch
from handtrack.fingers.densities import Box, GaussianMixture, Gaussians, Mixture
from handtrack.fingers.filter import FilterSettings, ParticleFilter
from handtrack.fingers.resampling import normalise

Q = np.array([0.3, 0.5]) ** 2
H = np.array([[1.0, 0.5], [0.0, 1.0], [1.0, -1.0]])
NOISE = np.array([0.8, 0.7, 1.2]) ** 2
P0 = np.array([2.0, 1.0])
FRAMES = 12
SHIFT = np.array([0.5, -0.2])


class Walk:
    """A random walk, sampled from something else on purpose."""

    def logPsi(self, X):
        return np.zeros(len(X))

    def M0(self):
        return Gaussians(np.ones(1), np.zeros((1, 2)), np.sqrt(P0))

    def M(self, X, W):
        return Gaussians(W, X, np.sqrt(Q))

    def importance(self, X, W, proposals=None):
        shifted = Gaussians(W, X + SHIFT, 2 * np.sqrt(Q))
        return Mixture((self.M(X, W), shifted), (0.4, 0.6))


def problem(seed):
    """A walk, its measurements and their log-likelihoods."""
    rng = np.random.default_rng(seed)
    X = rng.normal(0, 0.5 * np.sqrt(P0))  # not in the tails, where no sample falls
    measured = []
    for t in range(FRAMES):
        X = X + (rng.normal(0, np.sqrt(Q)) if t else 0)
        measured.append(H @ X + rng.normal(0, np.sqrt(NOISE)))
    return measured


def log_likelihood(z):
    constant = -0.5 * np.sum(np.log(2 * np.pi * NOISE))
    return lambda X: constant - 0.5 * np.sum((z - X @ H.T) ** 2 / NOISE, axis=1)


def kalman(measured):
    """Means, covariances and log evidences of the same problem."""
    m, P, out = np.zeros(2), np.diag(P0), []
    for t, z in enumerate(measured):
        P = P + (np.diag(Q) if t else 0)
        S = H @ P @ H.T + np.diag(NOISE)
        K = P @ H.T @ np.linalg.inv(S)
        error = z - H @ m
        log_z = -0.5 * (error @ np.linalg.solve(S, error) + np.log(np.linalg.det(2 * np.pi * S)))
        m, P = m + K @ error, P - K @ H @ P
        out.append((m, P, log_z))
    return out


def schemes(samples):
    plain = FilterSettings(samples, ess_share=0, ancestors=samples)
    annealed = FilterSettings(samples, ess_share=0.5, layers=20, moves=3, ancestors=samples)
    return {
        "importance": ParticleFilter(Walk(), plain),
        "annealed": ParticleFilter(Walk(), annealed),
        "condensation": Condensation(Walk().M0(), np.sqrt(Q), samples),
    }


@pytest.mark.parametrize("name", ["importance", "annealed", "condensation"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_means_covariances_and_evidence_are_kalmans(name, seed):
    scheme = schemes(600 if name == "annealed" else 1500)[name]
    measured = problem(seed)
    rng = np.random.default_rng(100 + seed)
    z_scores, before = [], np.inf
    for z, (m, P, log_z) in zip(measured, kalman(measured), strict=True):
        posterior = scheme.step(rng, log_likelihood(z))
        std = np.sqrt(np.diag(P))
        one = 1 / np.sqrt(min(posterior.ess, before))  # a mean's error, in standard deviations
        before = posterior.ess
        z_scores.append((posterior.mean - m) / std / one)
        assert posterior.exponent == 1
        assert np.allclose(posterior.mean / std, m / std, atol=5 * one)
        scale = np.outer(std, std)
        assert np.allclose(posterior.cov / scale, P / scale, atol=5 * one)
        assert posterior.log_evidence == pytest.approx(log_z, abs=5 * one)
    assert np.sqrt(np.mean(np.square(z_scores))) < 2  # errors are no larger than sampling makes


def test_a_filter_that_forgets_to_compensate_is_noticed():
    """The bounds above do fail: the same filter without f / g."""

    class Forgetful(Walk):
        def M(self, X, W):
            return self.importance(X, W)

        def importance(self, X, W, proposals=None):
            return Gaussians(W, X + SHIFT, 2 * np.sqrt(Q))

    scheme = ParticleFilter(Forgetful(), FilterSettings(1500, ess_share=0, ancestors=1500))
    rng, measured = np.random.default_rng(0), problem(1)
    z_scores = []
    for z, (m, P, _) in zip(measured, kalman(measured), strict=True):
        posterior = scheme.step(rng, log_likelihood(z))
        z_scores.append((posterior.mean - m) / np.sqrt(np.diag(P)) * np.sqrt(posterior.ess))
    assert np.sqrt(np.mean(np.square(z_scores))) > 3


@pytest.mark.parametrize("layers", [1, 20])
def test_what_is_natural_counts_as_prior(layers):
    """A Gaussian Psi is one more measurement, which Kalman's filter can take in."""
    pull, at = 4.0, np.array([0.5, -0.5])

    class Natural(Walk):
        def logPsi(self, X):
            return -pull / 2 * np.sum((X - at) ** 2, axis=1)

    z = np.array([1.0, 0.5, 0.3])
    share = 0.5 if layers > 1 else 0.0
    settings = FilterSettings(4000, share, layers, moves=2)
    posterior = ParticleFilter(Natural(), settings).step(
        np.random.default_rng(0), log_likelihood(z)
    )
    precision = np.diag(1 / P0) + H.T @ np.diag(1 / NOISE) @ H + pull * np.eye(2)
    mean = np.linalg.solve(precision, H.T @ (z / NOISE) + pull * at)
    std = np.sqrt(np.diag(np.linalg.inv(precision)))
    assert np.allclose(posterior.mean / std, mean / std, atol=5 / np.sqrt(posterior.ess))


def test_evidence_is_unbiased():
    """The mean of the evidence (not of its logarithm) over many small filters is Kalman's."""
    z = np.array([1.0, 0.5, 0.3])
    truth = np.exp(kalman([z])[0][2])
    rng = np.random.default_rng(0)
    hint = GaussianMixture(np.ones(1), np.array([[0.7, 0.4]]), 0.5 * np.eye(2)[None])
    found = []
    for _ in range(600):
        scheme = ParticleFilter(Walk(), FilterSettings(50, ess_share=0))
        found.append(np.exp(scheme.step(rng, log_likelihood(z), hint).log_evidence))
    assert abs(np.mean(found) - truth) < 4 * np.std(found) / np.sqrt(600)
    assert np.std(found) < 0.5 * truth


def test_peaked_likelihoods_are_tempered_and_annealing_reaches_further():
    def peaked(X):
        return -5e4 * np.sum((X - 0.3) ** 2, axis=1)

    once = ParticleFilter(Walk(), FilterSettings(200, ess_share=0.3))
    many = ParticleFilter(Walk(), FilterSettings(200, ess_share=0.3, layers=15))
    untempered = ParticleFilter(Walk(), FilterSettings(200, ess_share=0))
    rng = np.random.default_rng(0)
    a, b, c = (s.step(rng, peaked) for s in (once, many, untempered))
    assert a.ess == pytest.approx(60, rel=0.01)
    assert a.exponent < 0.01
    assert b.exponent == 1
    assert b.ess >= 60 * 0.99
    assert np.abs(b.mean - 0.3).max() < 0.01
    assert c.ess < 10


def test_again_starts_from_the_posterior_before():
    measured = problem(1)
    once, twice = (ParticleFilter(Walk(), FilterSettings(4000, ess_share=0)) for _ in range(2))
    rng = np.random.default_rng(0)
    for z in measured[:3]:
        once.step(rng, log_likelihood(z))
        twice.step(rng, lambda X: -np.sum((X - 9) ** 2, axis=1))
        twice.step(rng, log_likelihood(z), again=True)
        twice.step(rng, log_likelihood(z), again=True)
    m, P, _ = kalman(measured[:3])[-1]
    for scheme in (once, twice):
        assert np.allclose(scheme.posterior.mean, m, atol=0.1)
        assert np.allclose(scheme.posterior.cov, P, atol=0.05)


def test_same_seed_same_particles():
    for name in ("importance", "annealed", "condensation"):
        runs = []
        for _ in range(2):
            scheme, rng = schemes(60)[name], np.random.default_rng(5)
            for z in problem(2)[:4]:
                scheme.step(rng, log_likelihood(z))
            runs.append(scheme.posterior)
        assert np.array_equal(runs[0].X, runs[1].X)
        assert np.array_equal(runs[0].W, runs[1].W)


def test_impossible_particles_and_frames():
    rng = np.random.default_rng(0)
    scheme = ParticleFilter(Walk(), FilterSettings(300, ess_share=0.3, layers=3))

    def half(X):
        return np.where(X[:, 0] > 0, 0.0, np.where(X[:, 1] > 0, np.nan, -np.inf))

    posterior = scheme.step(rng, half)
    assert posterior.W[posterior.X[:, 0] <= 0].max(initial=0) == 0
    assert posterior.mean[0] > 0
    nothing = scheme.step(rng, lambda X: np.full(len(X), -np.inf))
    assert nothing.log_evidence == -np.inf
    assert nothing.exponent == 0
    assert np.isfinite(nothing.mean).all()
    assert nothing.W.sum() == pytest.approx(1)
    assert np.allclose(nothing.mean, posterior.mean, atol=0.3)  # carried over
    assert np.isfinite(scheme.step(rng, half).mean).all()


def test_restart_from_a_known_configuration():
    there = Gaussians(np.ones(1), np.array([[5.0, -5.0]]), np.full(2, 0.01))
    rng = np.random.default_rng(0)
    for scheme in (
        *schemes(100).values(),
        RandomSearch(Box(-np.ones(2), np.ones(2)), 100),
    ):
        scheme.step(rng, log_likelihood(np.zeros(3)))
        scheme.restart(there)
        assert scheme.posterior is None
        assert np.allclose(scheme.step(rng, lambda X: 0 * X[:, 0]).mean, [5, -5], atol=0.1)


def test_posteriors_are_read_only_and_weighted():
    posterior = schemes(50)["importance"].step(
        np.random.default_rng(0), log_likelihood(np.zeros(3))
    )
    with pytest.raises(ValueError, match="read-only"):
        posterior.X[0] = 1
    assert np.allclose(posterior.mean, posterior.W @ posterior.X)
    assert np.allclose(posterior.cov, np.cov(posterior.X.T, aweights=posterior.W, ddof=0))
    assert posterior.map_X in posterior.X
    assert np.allclose(posterior.W, normalise(np.log(posterior.W)))


def test_settings_are_checked():
    for wrong in ({"particles": 0}, {"ess_share": 1.0}, {"limit": 0.0}, {"layers": 0}):
        with pytest.raises(InputError, match="filter"):
            FilterSettings(**wrong)
