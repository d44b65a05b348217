"""The configuration space: 20 angles in a few dimensions, and the lines between basis states.

Natural hands fill little of the 20 dimensions of their angles (paper, Section 2.2). Principal
components of a sample of angles, ``theta = mean + X C`` with orthonormal rows ``C`` ``(k, 20)``,
bring them to ``k = 7``. In there lie the *basis states*, each finger fully extended or fully
curled (:mod:`handtrack.hand.basis`), and natural motion keeps near the straight lines between
them (:mod:`handtrack.hand.lines`).

>>> space = default()
>>> space.components.shape, space.basis_X.shape, len(space.lines)
((7, 20), (28, 7), 378)
>>> nearest = space.nearest_line(space.basis_X[:1])
>>> float(nearest.distance[0].round(6)), 0 in nearest.pair[0]
(0.0, True)
"""

import json
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, OutputError
from handtrack.hand.lines import NearestLine, nearest_line
from handtrack.hand.skeleton import LIMITS, N_ANGLES
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]
FORMAT_VERSION = 1
#: The prior of the refinement: covariance times this, plus this standard deviation squared.
PRIOR_WIDENING, PRIOR_FLOOR_DEG = 2.25, 6.0


@dataclass(frozen=True, eq=False)
class ConfigurationSpace:
    """A linear space of hand configurations with its basis states.

    Parameters
    ----------
    mean : (20,) of the sample, radians.
    components : (k, 20) orthonormal rows, the principal directions.
    spectrum : (20,) variances along all principal directions, falling, radians squared.
    covariance : (20, 20) of the whole sample.
    extended, curled : (20,) the hand with all digits extended, and with all curled.
    basis_curled : (m, 5) which digits are curled in each.
    support : (32,) share of recorded frames at each of the 32 patterns, which are numbered in
        binary: thumb 16, index 8, middle 4, ring 2, little 1.
    falling : (32,) the patterns in the order in which they fall, the least supported first.
    provenance : what it was fitted from: sources, licences, counts, seed, settings.
    """

    mean: Array
    components: Array
    spectrum: Array
    covariance: Array
    extended: Array
    curled: Array
    basis_curled: NDArray[np.bool_]
    support: Array
    falling: NDArray[np.int64]
    provenance: dict[str, Any]

    def __post_init__(self) -> None:
        freeze_arrays(self)
        k, m = len(self.components), len(self.basis_curled)
        wanted = {
            "mean": (N_ANGLES,),
            "components": (k, N_ANGLES),
            "spectrum": (N_ANGLES,),
            "covariance": (N_ANGLES, N_ANGLES),
            "extended": (N_ANGLES,),
            "curled": (N_ANGLES,),
            "basis_curled": (m, 5),
            "support": (32,),
            "falling": (32,),
        }
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise InputError(f"configuration space: {name} is not {shape}")

    @property
    def n_dims(self) -> int:
        """Dimensions kept, ``k``."""
        return len(self.components)

    @property
    def variance(self) -> Array:
        """Variances ``(k,)`` along the dimensions kept."""
        return self.spectrum[: self.n_dims]

    @property
    def basis_theta(self) -> Array:
        """Angles ``(m, 20)`` of the basis states."""
        return np.where(np.repeat(self.basis_curled, 4, axis=1), self.curled, self.extended)

    @cached_property
    def basis_X(self) -> Array:
        """The basis states ``(m, k)``, read-only."""
        X = self.to_X(self.basis_theta)
        X.setflags(write=False)
        return X

    @property
    def basis_names(self) -> tuple[str, ...]:
        """A name for each basis state, the digits that are curled."""
        return tuple(state_name(curled) for curled in self.basis_curled)

    @property
    def dropped(self) -> tuple[tuple[str, float], ...]:
        """The patterns that are no basis states, by name, each with its support."""
        kept = set((self.basis_curled @ PATTERN_WEIGHTS).tolist())
        return tuple(
            (state_name(ALL_PATTERNS[p]), float(self.support[p]))
            for p in range(32)
            if p not in kept
        )

    @cached_property
    def lines(self) -> NDArray[np.int64]:
        """All pairs ``(m (m - 1) / 2, 2)`` of basis states, ``i < j``."""
        return np.stack(np.triu_indices(len(self.basis_curled), 1), axis=1)

    def to_X(self, theta: ArrayLike) -> Array:
        """Coordinates ``(..., k)`` of angles ``(..., 20)``: their orthogonal projection."""
        return (np.asarray(theta, float) - self.mean) @ self.components.T

    def to_angles(self, X: ArrayLike, clip: bool = True) -> Array:
        """Angles ``(..., 20)`` of coordinates ``(..., k)``, kept inside the limits if ``clip``."""
        theta = self.mean + np.asarray(X, float) @ self.components
        return np.clip(theta, LIMITS[:, 0], LIMITS[:, 1]) if clip else theta

    def nearest_line(self, X: ArrayLike) -> NearestLine:
        """The nearest line, place on it, foot and distance of each configuration ``(n, k)``.

        At a basis state all lines through it are equally near; the first of them is named.
        """
        return nearest_line(X, self.basis_X)

    def prior_covariance(
        self, widening: float = PRIOR_WIDENING, floor_deg: float = PRIOR_FLOOR_DEG
    ) -> Array:
        """Covariance ``(20, 20)`` of a Gaussian prior on angles: widened, with a floor."""
        return self.covariance * widening + np.eye(N_ANGLES) * np.radians(floor_deg) ** 2

    def with_dims(self, k: int) -> "ConfigurationSpace":
        """The same sample and basis states in ``k`` dimensions.

        Raises
        ------
        InputError
            ``k`` is not from 1 to 20.
        """
        if not 1 <= k <= N_ANGLES:
            raise InputError(f"a configuration space has 1 to {N_ANGLES} dimensions, not {k}")
        return replace(self, components=principal(self.covariance)[1][:k])

    def with_basis(self, keep: int) -> "ConfigurationSpace":
        """The same space with the ``keep`` best supported of the 32 basis states.

        Raises
        ------
        InputError
            ``keep`` is not from 2 to 32.
        """
        return replace(self, basis_curled=kept_patterns(self.falling, keep))

    def save(self, path: str | Path) -> None:
        """Write a file that :func:`load` reads.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        try:
            with open(path, "wb") as file:
                np.savez_compressed(
                    file,
                    version=np.int64(FORMAT_VERSION),
                    provenance=np.str_(json.dumps(self.provenance, sort_keys=True)),
                    **arrays,
                )
        except OSError as error:
            raise OutputError(f"{path}: cannot write the space ({error.strerror})") from error


_ARRAYS = tuple(name for name in ConfigurationSpace.__dataclass_fields__ if name != "provenance")
#: The number of a pattern is its bits times these, thumb to little.
PATTERN_WEIGHTS = np.array([16, 8, 4, 2, 1])
#: The 32 patterns ``(32, 5)`` of curled digits, in the order of their numbers.
ALL_PATTERNS = (np.arange(32)[:, None] & PATTERN_WEIGHTS) > 0
_LETTERS = "TIMRL"


def kept_patterns(falling: NDArray[np.int64], keep: int) -> NDArray[np.bool_]:
    """The ``keep`` patterns ``(keep, 5)`` that fall last, in the order of their numbers.

    Raises
    ------
    InputError
        ``keep`` is not from 2 to 32.
    """
    if not 2 <= keep <= len(ALL_PATTERNS):
        raise InputError(f"keep {keep} basis states: wanted 2 to {len(ALL_PATTERNS)}")
    return ALL_PATTERNS[np.sort(falling[len(falling) - keep :])]


def state_name(curled: ArrayLike) -> str:
    """Five letters, the digit's initial where it is curled and ``-`` where it is extended.

    >>> state_name([False, False, True, False, True])
    '--M-L'
    """
    return "".join(c if bent else "-" for c, bent in zip(_LETTERS, np.asarray(curled), strict=True))


def principal(covariance: Array) -> tuple[Array, Array]:
    """Variances ``(20,)``, falling, and directions ``(20, 20)`` in rows, of a covariance.

    The sign of a direction is free; its largest entry is made positive.
    """
    directions, variances, _ = np.linalg.svd(covariance, hermitian=True)
    rows = directions.T
    largest = rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)]
    return variances, rows * np.sign(largest)[:, None]


def load(path: str | Path) -> ConfigurationSpace:
    """Read what :meth:`ConfigurationSpace.save` wrote; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        The file is missing, is not such a file, or is of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            if int(data["version"]) != FORMAT_VERSION:
                raise InputError(f"{path}: space file version {data['version']}")
            provenance = json.loads(str(data["provenance"]))
            return ConfigurationSpace(**{n: data[n] for n in _ARRAYS}, provenance=provenance)
    except OSError as error:
        raise InputError(f"{path}: cannot read the space ({error.strerror or error})") from error
    except (KeyError, ValueError, EOFError, BadZipFile) as error:
        raise InputError(f"{path}: not a configuration space ({error})") from error


@cache
def default() -> ConfigurationSpace:
    """The space that comes with the package."""
    with resources.as_file(resources.files("handtrack.hand").joinpath("data/space.npz")) as path:
        return load(path)
