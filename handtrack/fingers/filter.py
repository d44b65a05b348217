"""The particle filter of the fingers: importance sampling with compensated weights (Section 4).

One step, with ``f`` the prior over the last posterior (times ``Psi``, how natural a configuration
is in any frame), ``g`` the importance function and ``G`` the likelihood::

    X_i ~ g,    w_i = f(X_i) / g(X_i) * G(X_i)                                   (7)

in logarithms. Because ``f`` and ``g`` are mixtures over *all* particles of t-1, evaluated as
such, drawing from them is the resampling, and no particle carries a history.

``G`` is tempered: it enters as ``G^beta`` with the largest ``beta`` that keeps ``ess_share`` of
the effective sample size. With ``layers > 1`` the step anneals: the tempered particles are
resampled and moved by Metropolis steps that leave ``f G^beta`` as it is, and the exponent rises
from layer to layer, to ``limit`` if the layers suffice (a sequential Monte Carlo sampler).
``Posterior.exponent`` says what was reached.

>>> import numpy as np
>>> from handtrack.fingers.dynamics import Dynamics
>>> from handtrack.hand import space
>>> settings = FilterSettings(particles=200, layers=8, ess_share=0.25)
>>> filter = ParticleFilter(Dynamics.about(space.default()), settings)
>>> there = filter.dynamics.space.basis_X[3]
>>> rng = np.random.default_rng(0)
>>> posterior = filter.step(rng, lambda X: -50 * np.sum((X - there) ** 2, axis=1))
>>> bool(np.abs(posterior.mean - there).max() < 0.3)
True
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.fingers.densities import Density, Mixture
from handtrack.fingers.resampling import (
    Scheme,
    ess,
    log_mean,
    normalise,
    power,
    resample,
    temper,
)
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]
LogLikelihood = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weighted particles of one moment, and what they say.

    ``exponent`` is the power of the likelihood that the weights hold, ``ess`` their effective
    sample size, ``map_X`` the particle of highest posterior density, ``log_evidence`` the
    estimated logarithm of the integral of prior times tempered likelihood.
    """

    X: Array  # (n, k)
    W: Array  # (n,) normalised
    logG: Array  # (n,)
    mean: Array  # (k,)
    cov: Array  # (k, k)
    map_X: Array  # (k,)
    ess: float
    exponent: float
    log_evidence: float

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of(
        cls, X: Array, log_w: Array, logG: Array, log_target: Array, exponent: float, log_z: float
    ) -> "Posterior":
        """From particles ``(n, k)``, log weights, log likelihoods and log densities ``(n,)``."""
        W = normalise(log_w)
        mean = W @ X
        cov = (X - mean).T @ ((X - mean) * W[:, None])
        best = X[np.argmax(log_target)]
        return cls(X, W, logG, mean, cov, best, ess(log_w), exponent, log_z)


class Filter(Protocol):
    """What the tracker asks of a scheme: ours, CONDENSATION and random search all have it."""

    @property
    def posterior(self) -> Posterior | None:
        """What the last step said; None before the first."""
        ...

    def step(
        self,
        rng: np.random.Generator,
        log_likelihood: LogLikelihood,
        proposals: Density | None = None,
        again: bool = False,
    ) -> Posterior:
        """Take in one frame, or with ``again`` the same frame once more."""
        ...

    def restart(self, start: Density | None = None) -> None:
        """Forget; the next step draws from ``start``, or from anywhere."""
        ...


class Model(Protocol):
    """Prior and importance function; :class:`handtrack.fingers.dynamics.Dynamics` is one."""

    def M0(self) -> Density:
        """The density before the first frame."""
        ...

    def M(self, X: Array, W: Array) -> Density:
        """The prior over a weighted posterior."""
        ...

    def importance(self, X: Array, W: Array, proposals: Density | None = None) -> Density:
        """What is sampled."""
        ...

    def logPsi(self, X: Array) -> Array:
        """How natural configurations are whatever the frame ``(n,)``; counts as prior."""
        ...


@dataclass(frozen=True)
class FilterSettings:
    """How many particles, and how the likelihood is let in."""

    particles: int = 100
    """Particles of a layer."""
    ess_share: float = 0.05
    """Share of the effective sample size that a layer keeps; 0 lets the likelihood in at once.
    One layer wants little, or the mean lags behind the hand; several want a quarter."""
    layers: int = 1
    """Most layers of annealing; 1 is a single importance sampling step, tempered."""
    limit: float = 1.0
    """Exponent at which the likelihood counts in full."""
    moves: int = 1
    """Metropolis steps between two layers."""
    ancestors: int = 200
    """Most particles of the last posterior that prior and importance function are built on."""
    resampling: Scheme = "systematic"
    """How they, and the particles between layers, are drawn."""

    def __post_init__(self) -> None:
        for name in ("particles", "layers", "ancestors"):
            if getattr(self, name) < 1:
                raise InputError(f"filter: {name} is {getattr(self, name)}, wanted 1 or more")
        if not 0 <= self.ess_share < 1 or not self.limit > 0 or self.moves < 0:
            raise InputError("filter: wanted 0 <= ess_share < 1, limit > 0 and moves >= 0")


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Particles inside a step: ``log_w`` holds ``f / g`` and ``G`` to the power ``exponent``."""

    X: Array
    log_f: Array
    logG: Array
    log_w: Array
    exponent: float = 0.0
    log_z: float = 0.0


class ParticleFilter:
    """Manifold importance sampling with compensated weights, tempered or annealed."""

    def __init__(self, dynamics: Model, settings: FilterSettings | None = None) -> None:
        self.dynamics = dynamics
        self.settings = settings or FilterSettings()
        self.posterior: Posterior | None = None
        self._before: Posterior | None = None
        self._start: Density | None = None

    def restart(self, start: Density | None = None) -> None:
        """Forget; the next step draws from ``start``, or from the model's ``M0``."""
        self.posterior = self._before = None
        self._start = start

    def step(
        self,
        rng: np.random.Generator,
        log_likelihood: LogLikelihood,
        proposals: Density | None = None,
        again: bool = False,
    ) -> Posterior:
        """Posterior after one more frame; ``again`` takes the last frame anew.

        Parameters
        ----------
        rng : numpy.random.Generator
            All randomness of the step.
        log_likelihood : callable
            ``X (n, k) -> logG (n,)``; minus infinity or NaN for what cannot be.
        proposals : Density, optional
            Hypotheses of a proposer.
        again : bool
            Start from the posterior *before* the last step: the palm was found better, and the
            same frame is looked at once more.
        """
        before = self._before if again else self.posterior
        f, g = self._prior_and_importance(rng, before, proposals)
        X = g.sample(rng, self.settings.particles)
        log_f = f.log_density(X) + self.dynamics.logPsi(X)
        cloud = _Cloud(X, log_f, _checked(log_likelihood(X)), log_f - g.log_density(X))  # (7)
        cloud = self._anneal(rng, cloud, f, log_likelihood)
        target = cloud.log_f + self.settings.limit * cloud.logG
        self._before = before
        self.posterior = Posterior.of(
            cloud.X, cloud.log_w, cloud.logG, target, cloud.exponent, cloud.log_z
        )
        return self.posterior

    def _prior_and_importance(
        self, rng: np.random.Generator, before: Posterior | None, proposals: Density | None
    ) -> tuple[Density, Density]:
        if before is None:
            start = self._start or self.dynamics.M0()
            return start, Mixture((start, proposals or start), (0.5, 0.5))
        X, W = before.X, before.W
        if len(X) > self.settings.ancestors:
            i = resample(rng, W, self.settings.ancestors, self.settings.resampling)
            i, count = np.unique(i, return_counts=True)
            X, W = X[i], count / count.sum()
        return self.dynamics.M(X, W), self.dynamics.importance(X, W, proposals)

    def _anneal(
        self, rng: np.random.Generator, cloud: _Cloud, f: Density, log_likelihood: LogLikelihood
    ) -> _Cloud:
        """Let the likelihood in, layer by layer; not at all where it is zero everywhere."""
        s = self.settings
        if not np.isfinite(cloud.logG).any():
            return replace(cloud, log_z=-np.inf)
        for layer in range(s.layers):
            if layer:
                cloud = self._move(rng, cloud, f, log_likelihood)
            rise = temper(cloud.log_w, cloud.logG, s.ess_share, s.limit - cloud.exponent)
            log_w = cloud.log_w + power(cloud.logG, rise)
            log_z = cloud.log_z + log_mean(log_w)
            cloud = replace(cloud, log_w=log_w, exponent=cloud.exponent + rise, log_z=log_z)
            if cloud.exponent >= s.limit:
                break
        return cloud

    def _move(
        self, rng: np.random.Generator, cloud: _Cloud, f: Density, log_likelihood: LogLikelihood
    ) -> _Cloud:
        """Resample, then Metropolis steps that leave ``f G^exponent`` as it is."""
        W = normalise(cloud.log_w)
        n, k = cloud.X.shape
        spread = cloud.X - W @ cloud.X
        cov = (spread.T * W) @ spread
        root = np.linalg.cholesky(cov + 1e-9 * (1e-9 + np.trace(cov)) * np.eye(k))
        i = resample(rng, W, n, self.settings.resampling)
        X, log_f, logG = cloud.X[i], cloud.log_f[i], cloud.logG[i]
        for _ in range(self.settings.moves):
            # the particles' covariance, times the 2.38^2 / k that is best for a Gaussian, and less
            # than that, as theirs may be several clusters
            reach = 2.38 / np.sqrt(k) * rng.uniform(0.1, 1.0, (n, 1))
            Y = X + reach * rng.standard_normal((n, k)) @ root.T
            log_fY = f.log_density(Y) + self.dynamics.logPsi(Y)
            logGY = _checked(log_likelihood(Y))
            gain = log_fY - log_f + power(logGY, cloud.exponent) - power(logG, cloud.exponent)
            accept = np.log(rng.random(n)) < gain
            X = np.where(accept[:, None], Y, X)
            log_f, logG = np.where(accept, log_fY, log_f), np.where(accept, logGY, logG)
        return replace(cloud, X=X, log_f=log_f, logG=logG, log_w=np.zeros(n))


def _checked(logG: Array) -> Array:
    """Log likelihoods with NaN read as impossible."""
    return np.where(np.isnan(logG), -np.inf, np.asarray(logG, float))
