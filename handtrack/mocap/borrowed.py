"""Poses that a data base lacks, borrowed from other people's hands.

Four clips of one performer do not hold every pose: a fist that none of them shows is reconstructed
as whatever comes nearest. The recorded motion that ships (:func:`recordings.shipped_motion`) holds
varied poses of other hands, and the data base itself tells where its markers are for given angles
(:mod:`handtrack.mocap.closing`). So some of those poses, evenly spaced, are put on the data base's
hand and join its frames; weights by distance see to it that they count only where nothing of its
own is near.

>>> rng = np.random.default_rng(0)
>>> theta = rng.uniform(0, 1, (200, 20))
>>> X = np.stack([np.cos(theta[:, 4:6]), np.sin(theta[:, 4:6]), theta[:, 4:6]], axis=-1)
>>> more, angles = enlarged(X, theta, 30)
>>> more.shape, bool(np.array_equal(angles[:200], theta))
((230, 2, 3), True)
"""

import numpy as np
from numpy.typing import NDArray

from handtrack.mocap import closing
from handtrack.mocap.recordings import shipped_motion

Array = NDArray[np.float64]


def enlarged(X_mm: Array, theta: Array, poses: int, n_markers: int = 0) -> tuple[Array, Array]:
    """A data base with so many poses of other hands behind its own frames.

    Parameters
    ----------
    X_mm : (N, M, 3) its markers, NaN where missing.
    theta : (N, 20) its angles.
    poses : how many to borrow, at most what ships; 0 gives the data base back.
    n_markers : the first so many columns are of the frame itself, the others of its neighbours in
        time; 0: all are. A borrowed pose holds still.
    """
    if poses == 0:
        return X_mm, theta
    known = shipped_motion().theta
    chosen = known[np.linspace(0, len(known) - 1, min(poses, len(known))).round().astype(int)]
    now = X_mm[:, : n_markers or None]
    whole = np.isfinite(now).all(axis=(1, 2))
    places = closing.fit(now[whole], theta[whole]).places(chosen)
    windows = X_mm.shape[1] // now.shape[1]
    return np.concatenate([X_mm, np.tile(places, (1, windows, 1))]), np.concatenate([theta, chosen])
