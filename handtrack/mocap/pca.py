"""Principal component analysis, as both halves of the marker method use it.

With the rows of ``X`` centred, ``X = U S V^T``: the rows of ``V^T`` are the components, and
``S^2 / (F - 1)`` their variances (the eigenvalues of the covariance).

>>> pca = fit(np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 1.0], [6.0, 1.0]]))
>>> pca.variance.round(3).tolist()
[6.936, 0.064]
>>> np.allclose(pca.back(pca.scores([[1.0, 5.0]])), [[1.0, 5.0]])
True
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.records import freeze_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pca:
    """Mean ``(D,)``, orthonormal components ``(K, D)`` and their variances ``(K,)``, falling."""

    mean: Array
    components: Array
    variance: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def scores(self, X: ArrayLike) -> Array:
        """Coordinates ``(..., K)`` of samples ``(..., D)``."""
        return np.asarray((np.asarray(X, float) - self.mean) @ self.components.T)

    def back(self, scores: ArrayLike) -> Array:
        """Samples ``(..., D)`` of the first ``k`` coordinates ``(..., k)``, the rest at zero."""
        z = np.asarray(scores, float)
        return np.asarray(z @ self.components[: z.shape[-1]] + self.mean)


def fit(X: ArrayLike) -> Pca:
    """All components of the samples ``(F, D)``."""
    samples = np.asarray(X, float)
    mean = samples.mean(axis=0)
    _, S, Vt = np.linalg.svd(samples - mean, full_matrices=False)
    return Pca(mean, Vt, S**2 / max(len(samples) - 1, 1))
