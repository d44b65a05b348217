"""How the fingers may move: the prior, and the importance function along the lines (Section 4).

The configuration of the fingers, ``X`` in ``R^7``, moves mostly along the lines between the basis
states (each finger extended or curled). With particles ``X_j`` of weights ``W_j`` at time t-1:

- ``M0`` is the density before anything was seen: about the basis states, or anywhere.
- ``M`` is the prior ``p(X_t | X_{t-1})`` over the posterior: a random walk,
  ``f(X) = sum_j W_j N(X; X_j, diag(sigma^2))``, and with a small share ``anywhere``, ``M0``: hands
  can move fast, and a hypothesis far from all particles must not have the weight zero.
- ``importance`` is what is sampled instead, a mixture of

  1. *lines*: ``X_j`` is projected on the nearest line ``b_a b_b``, giving the foot
     ``b_a + s_t (b_b - b_a)``; ``s ~ N(s_t, line_sigma)`` along the line, then a random walk off
     it. At a basis state the 27 lines through it are equally likely.
  2. *walk*: the random walk about the posterior,
  3. *proposals* of a proposer, when there are any (regression from fingertips, say),
  4. *anywhere*, as in the prior.

- ``logPsi`` says how natural ``X`` is in any frame: hands keep near the lines, so it falls with
  the distance ``d`` to the nearest one as ``-d^2 / (2 near^2)``. Without it the walk drifts to
  postures that an image cannot refuse (straight fingers bent back at the knuckles).

Every part is a :class:`~handtrack.fingers.densities.Density`, so ``g(X)`` is exact, and equation
(7)'s compensation ``f(X) / g(X)`` is at most ``1 / walk``, the share of the second part.

>>> import numpy as np
>>> from handtrack.hand import space
>>> dynamics = Dynamics.about(space.default())
>>> X = dynamics.M0().sample(np.random.default_rng(0), 100)
>>> X.shape == (100, dynamics.sigma.size)
True
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.fingers.densities import Density, Gaussians, Mixture
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]


class Space(Protocol):
    """What the dynamics ask of a configuration space: basis states and the nearest line."""

    @property
    def basis_X(self) -> Array:
        """Basis states ``(n_basis, k)``."""
        ...

    @property
    def variance(self) -> Array:
        """Variance ``(k,)`` of the configurations, whose mean is the origin."""
        ...

    def nearest_line(self, X: Array) -> tuple[NDArray[np.int_], Array, Array, Array]:
        """For ``X (n, k)``: pair of basis states ``(n, 2)``, ``s (n,)``, foot, distance."""
        ...


@dataclass(frozen=True)
class Shares:
    """How the samples divide over the parts of the importance function; any positive sum.

    The share of the proposals goes to the others in frames without any.
    """

    lines: float = 0.45
    walk: float = 0.35
    proposals: float = 0.15
    anywhere: float = 0.05


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Prior and importance function over a configuration space.

    Parameters
    ----------
    space : Space
        Basis states and lines.
    sigma : (k,)
        The prior's random walk in one frame.
    off_sigma : (k,)
        The random walk off a line.
    line_sigma : float
        Standard deviation of ``s``; the whole line from state to state is 1.
    at_basis : float
        A foot nearer to a basis state than this share of the line is at it.
    anywhere : float
        Share of the prior that is ``M0``.
    near : float
        How far from the lines hands are, in radians (over all angles); infinite for anywhere.
    shares : Shares
        Of the importance function.

    Raises
    ------
    InputError
        A spread is not positive, or a share is negative.
    """

    space: Space
    sigma: Array
    off_sigma: Array
    line_sigma: float = 0.15
    at_basis: float = 0.05
    anywhere: float = 0.01
    near: float = 0.3
    shares: Shares = Shares()

    def __post_init__(self) -> None:
        freeze_arrays(self)
        for name in ("sigma", "off_sigma", "line_sigma", "near"):
            if not np.min(getattr(self, name)) > 0:
                raise InputError(f"dynamics: {name} must be positive")
        s = self.shares
        if min(s.lines, s.proposals, s.anywhere, self.anywhere) < 0 or s.walk <= 0:
            raise InputError("dynamics: shares must not be negative, and 'walk' must be positive")
        if self.anywhere > 0 and s.anywhere == 0:
            raise InputError("dynamics: the prior's 'anywhere' needs a share of the importance")

    @classmethod
    def about(
        cls, space: Space, walk: float = 0.2, off: float = 0.08, **settings: Any
    ) -> "Dynamics":
        """Spreads as shares of the space's own: ``walk`` a frame, ``off`` the lines."""
        spread = np.sqrt(space.variance)
        return cls(space, walk * spread, off * spread, **settings)

    def M0(self) -> Density:
        """Before anything was seen: half about the basis states, half anywhere in the space."""
        b = self.space.basis_X
        spread = np.sqrt(self.space.variance)
        states = Gaussians(np.ones(len(b)), b, spread / 3)
        return Mixture((states, Gaussians(np.ones(1), 0 * b[:1], spread)), (0.5, 0.5))

    def M(self, X: Array, W: Array) -> Density:
        """The prior ``p(X_t | X_{t-1})`` over particles ``X (n, k)`` of weights ``W (n,)``."""
        walk = Gaussians(W, X, self.sigma)
        return Mixture((walk, self.M0()), (1 - self.anywhere, self.anywhere))

    def logPsi(self, X: Array) -> Array:
        """How natural configurations ``(n, k)`` are whatever the frame, ``(n,)``."""
        distance = self.space.nearest_line(X)[3]
        return np.asarray(-0.5 * (distance / self.near) ** 2)

    def importance(self, X: Array, W: Array, proposals: Density | None = None) -> Density:
        """The density ``g`` that is sampled; see the module."""
        s = self.shares
        walk = Gaussians(W, X, self.sigma)
        parts: tuple[Density, ...] = (self.lines(X, W), walk, proposals or walk, self.M0())
        return Mixture(parts, (s.lines, s.walk, s.proposals if proposals else 0.0, s.anywhere))

    def lines(self, X: Array, W: Array) -> Gaussians:
        """Along the nearest lines, and about them."""
        b = self.space.basis_X
        pair, _, foot, _ = self.space.nearest_line(X)
        direction = b[pair[:, 1]] - b[pair[:, 0]]  # (n, k)
        length = np.linalg.norm(direction, axis=1)
        gap = np.linalg.norm(foot[:, None] - b[pair], axis=2) / length[:, None]  # (n, 2) to ends
        at = gap.min(axis=1) < self.at_basis
        state = np.take_along_axis(pair, gap.argmin(axis=1)[:, None], axis=1)[at, 0]
        fan = b[None] - b[state, None]  # (n_at, n_basis, k): one of them is no line at all
        real = np.arange(len(b)) != state[:, None]
        n_fan = len(b) - 1
        return Gaussians(
            np.concatenate([W[~at], np.repeat(W[at] / n_fan, n_fan)]),
            np.concatenate([foot[~at], np.repeat(foot[at], n_fan, axis=0)]),
            self.off_sigma,
            self.line_sigma * np.concatenate([direction[~at], fan[real]]),
        )
