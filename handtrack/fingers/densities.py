"""Densities that can be sampled *and* evaluated exactly: what importance sampling is made of.

A :class:`Density` has ``sample(rng, n)`` and ``log_density(X)``. Mixtures are sampled in strata
(systematic resampling of their components) and evaluated as the whole mixture, whichever
component a sample came from; this is unbiased and never has a weight above ``1 / share`` of the
component that covers the target.

>>> import numpy as np
>>> wide = Gaussians(np.ones(1), np.zeros((1, 2)), np.array([2.0, 2.0]))
>>> both = Mixture((wide, wide), (0.3, 0.7))
>>> X = both.sample(np.random.default_rng(0), 10)
>>> X.shape, bool(np.allclose(both.log_density(X), wide.log_density(X)))
((10, 2), True)
"""

from dataclasses import dataclass, field
from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.fingers.resampling import systematic
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]
LOG_2PI = float(np.log(2 * np.pi))


class Density(Protocol):
    """A probability density over ``R^k``."""

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw ``(n, k)``."""
        ...

    def log_density(self, X: Array) -> Array:
        """Log density ``(n,)`` at ``X`` ``(n, k)``."""
        ...


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Gaussians of one axis-parallel spread, each stretched along a direction of its own.

    Component ``i`` is ``mean_i + sigma * N(0, I) + stretch_i * N(0, 1)``: a random walk about a
    point, or along and about a line. Its covariance ``diag(sigma^2) + stretch stretch^T`` is
    inverted in closed form, so a thousand components cost little.

    Parameters
    ----------
    weights : (m,)
        Not negative, any sum but zero.
    means : (m, k)
    sigma : (k,)
        Positive.
    stretch : (m, k), optional
        No stretch if left out.
    """

    weights: Array
    means: Array
    sigma: Array
    stretch: Array | None = None

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw ``(n, k)``, the components in equal strides of their weights."""
        i = systematic(rng, self.weights, n)
        X = self.means[i] + self.sigma * rng.standard_normal((n, len(self.sigma)))
        if self.stretch is not None:
            X += self.stretch[i] * rng.standard_normal((n, 1))
        return X

    def log_density(self, X: Array) -> Array:
        """Log density ``(n,)`` of the whole mixture at ``X`` ``(n, k)``."""
        stretch = np.zeros((1, len(self.sigma))) if self.stretch is None else self.stretch
        c = np.broadcast_to(stretch / self.sigma, self.means.shape).copy()
        with np.errstate(divide="ignore"):  # a component without weight is log 0
            log_weights = np.log(self.weights / self.weights.sum())
        out = np.empty(len(X))
        _log_mixture(X / self.sigma, self.means / self.sigma, c, log_weights, out)
        return out - np.sum(np.log(self.sigma)) - len(self.sigma) / 2 * LOG_2PI


@numba.njit(cache=True)
def _log_mixture(Y, means, c, log_weights, out):  # type: ignore[no-untyped-def]
    """Log of ``sum_i w_i N(y; mean_i, I + c_i c_i^T)`` less the constant, for rows of ``Y``."""
    m, k = means.shape
    terms = np.empty(m)
    inverse, constant = np.empty(m), np.empty(m)
    for i in range(m):
        cc = 0.0
        for j in range(k):
            cc += c[i, j] ** 2
        inverse[i] = 1 / (1 + cc)
        constant[i] = log_weights[i] - 0.5 * np.log1p(cc)
    for n in range(Y.shape[0]):
        top = -np.inf
        for i in range(m):
            q, along = 0.0, 0.0
            for j in range(k):
                d = Y[n, j] - means[i, j]
                q += d * d
                along += d * c[i, j]
            terms[i] = constant[i] - 0.5 * (q - along * along * inverse[i])
            top = max(top, terms[i])
        total = 0.0
        for i in range(m):
            if terms[i] > top - 40:
                total += np.exp(terms[i] - top)
        out[n] = top + np.log(total)


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """A few Gaussians of any covariance: the weighted hypotheses of a proposer.

    Parameters
    ----------
    weights : (m,)
        Not negative, any sum but zero.
    means : (m, k)
    covariances : (m, k, k)

    Raises
    ------
    InputError
        The shapes disagree or a covariance is not positive definite.
    """

    weights: Array
    means: Array
    covariances: Array
    _root: Array = field(init=False, repr=False)  # Cholesky factors (m, k, k)

    def __post_init__(self) -> None:
        m, k = self.means.shape
        if self.weights.shape != (m,) or self.covariances.shape != (m, k, k):
            raise InputError(
                f"hypotheses: weights {self.weights.shape}, means {self.means.shape} and "
                f"covariances {self.covariances.shape} do not go together"
            )
        try:
            root = np.linalg.cholesky(self.covariances)
        except np.linalg.LinAlgError as error:
            raise InputError("hypotheses: a covariance is not positive definite") from error
        object.__setattr__(self, "_root", root)
        freeze_arrays(self)

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw ``(n, k)``."""
        i = systematic(rng, self.weights, n)
        noise = rng.standard_normal((n, self.means.shape[1], 1))
        return np.asarray(self.means[i] + (self._root[i] @ noise)[..., 0])

    def log_density(self, X: Array) -> Array:
        """Log density ``(n,)`` at ``X`` ``(n, k)``."""
        k = self.means.shape[1]
        d = np.swapaxes(X[None] - self.means[:, None], 1, 2)  # (m, k, n)
        q = np.sum(np.linalg.solve(self._root, d) ** 2, axis=1)  # (m, n)
        log_det = np.sum(np.log(np.diagonal(self._root, axis1=1, axis2=2)), axis=1)
        with np.errstate(divide="ignore"):
            log_w = np.log(self.weights / self.weights.sum()) - log_det
        terms = log_w[:, None] - q / 2 - k / 2 * LOG_2PI
        return np.asarray(np.logaddexp.reduce(terms, axis=0))


@dataclass(frozen=True, eq=False)
class Box:
    """The uniform density between two corners ``low`` and ``high`` ``(k,)``."""

    low: Array
    high: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw ``(n, k)``."""
        return rng.uniform(self.low, self.high, (n, len(self.low)))

    def log_density(self, X: Array) -> Array:
        """Log density ``(n,)``: minus infinity outside."""
        outside = (self.low > X) | (self.high < X)
        return np.where(outside.any(axis=1), -np.inf, -np.sum(np.log(self.high - self.low)))


@dataclass(frozen=True)
class Mixture:
    """Densities ``parts`` in proportion to ``shares``; parts of no share are never asked."""

    parts: tuple[Density, ...]
    shares: tuple[float, ...]

    def _used(self) -> tuple[list[Density], Array]:
        used = [i for i, share in enumerate(self.shares) if share > 0]
        shares = np.array([self.shares[i] for i in used])
        return [self.parts[i] for i in used], shares / shares.sum()

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw ``(n, k)``, the parts in strata."""
        parts, shares = self._used()
        counts = np.bincount(systematic(rng, shares, n), minlength=len(parts))
        drawn = [part.sample(rng, int(c)) for part, c in zip(parts, counts, strict=True) if c]
        return np.concatenate(drawn)

    def log_density(self, X: Array) -> Array:
        """Log density ``(n,)`` of the whole mixture."""
        parts, shares = self._used()
        terms = [np.log(s) + part.log_density(X) for part, s in zip(parts, shares, strict=True)]
        return np.asarray(np.logaddexp.reduce(terms, axis=0))
