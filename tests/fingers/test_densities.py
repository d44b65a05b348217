"""Densities against SciPy, quadrature and their own samples."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from handtrack.errors import InputError
from handtrack.fingers.densities import Box, GaussianMixture, Gaussians, Mixture


def example(k, m=5, seed=0):
    """One of each kind in ``R^k``."""
    rng = np.random.default_rng(seed)
    weights, means = rng.uniform(0.1, 1, m), rng.normal(0, 1, (m, k))
    weights[0] = 0
    sigma, stretch = rng.uniform(0.3, 0.8, k), rng.normal(0, 1, (m, k))
    A = rng.normal(size=(m, k, k))
    covariances = 0.2 * np.eye(k) + 0.3 * A @ np.swapaxes(A, 1, 2)
    stretched = Gaussians(weights, means, sigma, stretch)
    full = GaussianMixture(weights, means, covariances)
    box = Box(-np.ones(k), 2 * np.ones(k))
    return {
        "plain": Gaussians(weights, means, sigma),
        "stretched": stretched,
        "full": full,
        "box": box,
        "mixture": Mixture((stretched, full, box, box), (0.2, 0.5, 0.3, 0.0)),
    }


KINDS = tuple(example(1))


def reference(weights, means, covariances, X):
    terms = [
        w * multivariate_normal(m, c).pdf(X)
        for w, m, c in zip(weights, means, covariances, strict=True)
    ]
    return np.log(np.sum(terms, axis=0) / np.sum(weights))


def test_densities_are_scipys():
    X = np.random.default_rng(1).normal(0, 2, (40, 7))
    d = example(7)
    plain, stretched, full = d["plain"], d["stretched"], d["full"]
    diagonal = np.diag(plain.sigma**2)
    covariances = diagonal + stretched.stretch[:, :, None] * stretched.stretch[:, None, :]
    assert np.allclose(
        plain.log_density(X), reference(plain.weights, plain.means, [diagonal] * 5, X)
    )
    assert np.allclose(
        stretched.log_density(X), reference(plain.weights, plain.means, covariances, X)
    )
    assert np.allclose(
        full.log_density(X), reference(full.weights, full.means, full.covariances, X)
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("k", [1, 2])
def test_densities_integrate_to_one(kind, k):
    axis = np.linspace(-16, 16, 4001 if k == 1 else 801)
    X = np.stack(np.meshgrid(*[axis] * k, indexing="ij"), -1).reshape(-1, k)
    total = np.exp(example(k)[kind].log_density(X)).sum() * (axis[1] - axis[0]) ** k
    assert total == pytest.approx(1, abs=3e-2 if kind in ("box", "mixture") else 1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_samples_come_from_the_density(kind):
    """``E_p[q / p] = 1`` on the support of p, and the first two moments agree with quadrature."""
    density = example(2)[kind]
    X = density.sample(np.random.default_rng(2), 40000)
    axis = np.linspace(-12, 12, 501)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    p = np.exp(density.log_density(grid))
    p /= p.sum()
    mean = p @ grid
    cov = (grid - mean).T @ ((grid - mean) * p[:, None])
    assert np.allclose(X.mean(axis=0), mean, atol=0.03)
    assert np.allclose(np.cov(X.T), cov, atol=0.06 * np.trace(cov))


def test_components_are_sampled_in_strata():
    means = np.arange(4.0)[:, None] * 100
    X = Gaussians(np.array([1, 2, 3, 4.0]), means, np.ones(1)).sample(np.random.default_rng(0), 100)
    assert np.bincount(np.round(X[:, 0] / 100).astype(int)).tolist() == [10, 20, 30, 40]


def test_far_points_do_not_underflow():
    density = example(7)["stretched"]
    values = density.log_density(np.full((1, 7), 1e3))
    assert np.isfinite(values).all()
    assert values < -1e5


def test_hypotheses_are_checked():
    with pytest.raises(InputError, match="positive definite"):
        GaussianMixture(np.ones(1), np.zeros((1, 2)), -np.eye(2)[None])
    with pytest.raises(InputError, match="go together"):
        GaussianMixture(np.ones(2), np.zeros((1, 2)), np.eye(2)[None])


def test_records_are_read_only():
    density = example(2)["stretched"]
    with pytest.raises(ValueError, match="read-only"):
        density.means[0] = 1
