"""The two schemes that the paper compares with, behind the filter's own interface.

:class:`Condensation` (Isard and Blake) draws from the prior: resample, random walk, weigh by the
likelihood. :class:`RandomSearch` draws anywhere in ``R^7``, every frame anew, and keeps the best.
The tracker takes either in place of :class:`~handtrack.fingers.filter.ParticleFilter` and does
not know which it has.

>>> import numpy as np
>>> from handtrack.fingers.densities import Box
>>> search = RandomSearch(Box(-np.ones(2), np.ones(2)), samples=5000)
>>> posterior = search.step(np.random.default_rng(0), lambda X: -1000 * np.sum(X**2, axis=1))
>>> bool(np.abs(posterior.map_X).max() < 0.05), len(posterior.X)
(True, 5000)
"""

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.fingers.densities import Density, Gaussians
from handtrack.fingers.filter import LogLikelihood, Posterior
from handtrack.fingers.resampling import log_mean, power, systematic, temper

Array = NDArray[np.float64]


class Condensation:
    """Sampling importance resampling from a random walk of spread ``sigma`` ``(k,)`` a frame.

    ``M0`` is where it starts. ``ess_share`` above 0 tempers the likelihood as our filter does;
    the paper's comparison has none.
    """

    def __init__(
        self, M0: Density, sigma: Array, samples: int = 3000, ess_share: float = 0.0
    ) -> None:
        if samples < 1 or not np.min(sigma) > 0:
            raise InputError("condensation: wanted one sample or more, and a positive sigma")
        self.M0, self.sigma, self.samples, self.ess_share = M0, sigma, samples, ess_share
        self.posterior: Posterior | None = None
        self._before: Posterior | None = None
        self._start = M0

    def restart(self, start: Density | None = None) -> None:
        """Forget; the next step draws from ``start``, or from ``M0``."""
        self.posterior = self._before = None
        self._start = start or self.M0

    def step(
        self,
        rng: np.random.Generator,
        log_likelihood: LogLikelihood,
        proposals: Density | None = None,
        again: bool = False,
    ) -> Posterior:
        """Posterior after one more frame; ``again`` takes the last one anew. No proposals."""
        before = self._before if again else self.posterior
        if before is None:
            X = self._start.sample(rng, self.samples)
        else:
            walk = rng.standard_normal((self.samples, len(self.sigma))) * self.sigma
            X = before.X[systematic(rng, before.W, self.samples)] + walk
        self._before = before
        self.posterior = _weigh(X, log_likelihood(X), self.ess_share)
        return self.posterior


class RandomSearch:
    """The best of ``samples`` draws from ``density``; with ``sigma``, from about the last best.

    Every frame stands alone unless ``sigma`` ``(k,)`` is given.
    """

    def __init__(self, density: Density, samples: int = 5000, sigma: Array | None = None) -> None:
        if samples < 1:
            raise InputError("random search: wanted one sample or more")
        self.density, self.samples, self.sigma = density, samples, sigma
        self.posterior: Posterior | None = None
        self._before: Posterior | None = None
        self._start: Density | None = None

    def restart(self, start: Density | None = None) -> None:
        """Forget; the next step draws from ``start``, or from ``density``."""
        self.posterior = self._before = None
        self._start = start

    def step(
        self,
        rng: np.random.Generator,
        log_likelihood: LogLikelihood,
        proposals: Density | None = None,
        again: bool = False,
    ) -> Posterior:
        """The search in one more frame; ``again`` searches the last one anew. No proposals."""
        before = self._before if again else self.posterior
        where = self.density
        if before is None and self._start is not None:
            where = self._start
        elif before is not None and self.sigma is not None:
            where = Gaussians(np.ones(1), before.map_X[None], self.sigma)
        X = where.sample(rng, self.samples)
        self._before = before
        self.posterior = _weigh(X, log_likelihood(X), 0.0)
        return self.posterior


def _weigh(X: Array, logG: Array, ess_share: float) -> Posterior:
    """Weights by the likelihood alone."""
    logG = np.where(np.isnan(logG), -np.inf, np.asarray(logG, float))
    beta = temper(np.zeros(len(X)), logG, ess_share)
    log_w = power(logG, beta)
    return Posterior.of(X, log_w, logG, logG, beta, log_mean(log_w))
