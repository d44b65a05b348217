"""The importance function on a small space of lines that can be drawn."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import norm

from handtrack.errors import InputError
from handtrack.fingers.densities import GaussianMixture
from handtrack.fingers.dynamics import Dynamics, Shares
from handtrack.hand import space

SIGMA = np.array([0.2, 0.3])
OFF = np.array([0.05, 0.05])


@dataclass(frozen=True)
class Triangle:
    """Three basis states in the plane, and the three lines between them."""

    basis_X: np.ndarray
    variance: np.ndarray

    def nearest_line(self, X):
        pairs = np.array([(0, 1), (0, 2), (1, 2)])
        a, b = self.basis_X[pairs[:, 0]], self.basis_X[pairs[:, 1]]
        along = ((X[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1)
        s = along.clip(0, 1)
        foot = a + s[..., None] * (b - a)
        distance = np.linalg.norm(X[:, None] - foot, axis=-1)
        i, n = distance.argmin(axis=1), np.arange(len(X))
        return pairs[i], s[n, i], foot[n, i], distance[n, i]


SPACE = Triangle(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]), np.array([2.0, 1.5]))
DYNAMICS = Dynamics(SPACE, SIGMA, OFF)
GRID_AXIS = np.linspace(-8, 10, 601)
GRID = np.stack(np.meshgrid(GRID_AXIS, GRID_AXIS, indexing="ij"), -1).reshape(-1, 2)
CELL = (GRID_AXIS[1] - GRID_AXIS[0]) ** 2


def proposals():
    return GaussianMixture(np.ones(1), np.array([[3.0, 3.0]]), 0.1 * np.eye(2)[None])


def test_every_density_integrates_to_one():
    X = np.array([[1.0, 0.3], [0.05, -0.05], [3.0, 3.0]])
    W = np.array([0.5, 0.3, 0.2])
    for density in (
        DYNAMICS.M0(),
        DYNAMICS.M(X, W),
        DYNAMICS.lines(X, W),
        DYNAMICS.importance(X, W),
        DYNAMICS.importance(X, W, proposals()),
    ):
        assert np.exp(density.log_density(GRID)).sum() * CELL == pytest.approx(1, abs=1e-3)


def test_samples_lie_along_the_nearest_line():
    lines = DYNAMICS.lines(np.array([[1.0, 0.3]]), np.ones(1))
    X = lines.sample(np.random.default_rng(0), 20000)
    assert np.allclose(X.mean(axis=0), [1.0, 0.0], atol=0.02)  # the foot
    along = np.hypot(DYNAMICS.line_sigma * 4, OFF[0])
    assert np.allclose(X.std(axis=0), [along, OFF[1]], rtol=0.03)


def test_at_a_basis_state_all_its_lines_are_equally_likely():
    lines = DYNAMICS.lines(np.array([[0.05, -0.05]]), np.ones(1))
    assert len(lines.means) == 2  # of 28 states, it would be 27
    assert np.allclose(lines.weights, 0.5)
    assert np.allclose(lines.stretch / DYNAMICS.line_sigma, [[4, 0], [0, 3]])
    X = lines.sample(np.random.default_rng(0), 10000)
    on_first, on_second = np.abs(X[:, 1]) < 3 * OFF[1], np.abs(X[:, 0]) < 3 * OFF[0]
    for on, off, length in ((on_first, on_second, 4), (on_second, on_first, 3)):
        left = norm.sf(3 * OFF[0], scale=np.hypot(DYNAMICS.line_sigma * length, OFF[0]))
        assert np.mean(on & ~off) == pytest.approx(0.5 * 2 * left, abs=0.02)
    assert np.mean(on_first | on_second) > 0.99


def test_in_the_real_space_27_lines_leave_a_basis_state():
    real = space.default()
    n = len(real.basis_X)
    dynamics = Dynamics.about(real)
    between = 0.7 * real.basis_X[3] + 0.3 * real.basis_X[8]
    lines = dynamics.lines(np.stack([real.basis_X[5], between]), np.array([0.6, 0.4]))
    assert len(lines.means) == 1 + (n - 1)
    assert np.allclose(lines.weights[1:], 0.6 / (n - 1))
    ends = real.basis_X[5] + lines.stretch[1:] / dynamics.line_sigma
    others = np.delete(real.basis_X, 5, axis=0)
    assert np.allclose(ends, others)
    X = dynamics.importance(real.basis_X[5:6], np.ones(1)).sample(np.random.default_rng(0), 400)
    assert np.median(real.nearest_line(X)[3]) < 2 * np.linalg.norm(dynamics.off_sigma)


def test_what_is_near_the_lines_is_natural():
    X = np.array([[2.0, 0.0], [0.0, 0.0], [2.0, 0.9], [4.0, 3.0]])
    distance = SPACE.nearest_line(X)[3]
    assert np.allclose(DYNAMICS.logPsi(X), -(distance**2) / (2 * DYNAMICS.near**2))
    assert np.allclose(DYNAMICS.logPsi(X[:2]), 0)
    assert np.allclose(Dynamics(SPACE, SIGMA, OFF, near=np.inf).logPsi(X), 0)


def test_weights_of_lines_are_those_of_the_particles():
    X = np.array([[1.0, 0.3], [0.05, -0.05], [0.2, 1.5]])
    W = np.array([0.5, 0.3, 0.2])
    assert DYNAMICS.lines(X, W).weights.sum() == pytest.approx(1)
    assert np.allclose(DYNAMICS.lines(X, W).weights, [0.5, 0.2, 0.15, 0.15])


@pytest.mark.parametrize("hypotheses", [None, proposals()])
def test_importance_weights_are_unbiased_and_bounded(hypotheses):
    """``E_g[(f / g) h] = E_f[h]`` for functions h whose means under the prior are known."""
    rng = np.random.default_rng(3)
    X = rng.normal(1, 1, (30, 2))
    W = rng.uniform(size=30)
    W /= W.sum()
    f, g = DYNAMICS.M(X, W), DYNAMICS.importance(X, W, hypotheses)
    p = np.exp(f.log_density(GRID)) * CELL
    estimates, ratios = [], []
    for _ in range(300):
        Y = g.sample(rng, 100)
        w = np.exp(f.log_density(Y) - g.log_density(Y))
        ratios.append(w.max())
        estimates.append([w.mean(), *(w @ Y / 100), w @ Y[:, 0] ** 2 / 100])
    truth = [1.0, *(p @ GRID), p @ GRID[:, 0] ** 2]
    error = np.mean(estimates, axis=0) - truth
    assert (np.abs(error) < 4 * np.std(estimates, axis=0) / np.sqrt(300)).all()
    used = 0.85 if hypotheses is None else 1.0
    assert max(ratios) <= used / DYNAMICS.shares.walk + 1e-9


def test_uncompensated_samples_would_be_biased():
    """The comparison above fails where g is taken for f."""
    rng = np.random.default_rng(3)
    X, W = np.array([[1.0, 1.2]]), np.ones(1)
    Y = DYNAMICS.importance(X, W).sample(rng, 20000)
    f = DYNAMICS.M(X, W).sample(rng, 20000)
    assert abs(Y[:, 1].mean() - f[:, 1].mean()) > 0.2


def test_settings_are_checked():
    with pytest.raises(InputError, match="sigma"):
        Dynamics(SPACE, np.zeros(2), OFF)
    with pytest.raises(InputError, match="walk"):
        Dynamics(SPACE, SIGMA, OFF, shares=Shares(walk=0))
    with pytest.raises(InputError, match="anywhere"):
        Dynamics(SPACE, SIGMA, OFF, shares=Shares(anywhere=0))
    quiet = Dynamics(SPACE, SIGMA, OFF, anywhere=0, shares=Shares(anywhere=0))
    X = np.zeros((1, 2))
    assert np.isfinite(quiet.M(X, np.ones(1)).log_density(X)).all()


def test_about_takes_shares_of_the_spaces_spread():
    dynamics = Dynamics.about(SPACE, walk=0.5, off=0.1)
    assert np.allclose(dynamics.sigma, 0.5 * np.sqrt(SPACE.variance))
    assert np.allclose(dynamics.off_sigma, 0.1 * np.sqrt(SPACE.variance))
