"""One sweep over the fingers: sampled configurations of one digit, the rest of the hand held.

Refinement alone sticks in local minima; a few samples a finger before it is what helps. With the
other digits held, the distances of the contour to them are computed once, so a sample costs only
its own three capsules. Samples run along the digit's line between its extended and its curled
state (the paper's linear manifolds, one digit at a time) and around the current angles.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import LIMITS
from handtrack.records import Pose
from handtrack.refine.residuals import (
    nearest_capsule,
    place_nodes,
    rho,
    sample_energy,
)
from handtrack.refine.solve import Prior, Refiner, _maps, _prior, prior_energy
from handtrack.refine.view import View

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SweepSettings:
    """How many samples a digit gets, and how far they spread."""

    samples: int = 40
    """Samples for each digit."""
    local_share: float = 0.4
    """Share drawn around the current angles; the rest runs along the line."""
    local_std_deg: float = 12.0
    """Spread of those."""
    line_std_deg: float = 7.0
    """Spread off the line."""


def propose(
    theta: Array, digit: int, line: Array, settings: SweepSettings, rng: np.random.Generator
) -> Array:
    """Candidates ``(n, 4)`` for a digit; ``line`` ``(2, 4)`` is its extended and curled state."""
    n_local = round(settings.samples * settings.local_share)
    n_line = settings.samples - n_local
    here = theta[4 * digit : 4 * digit + 4]
    local = here + rng.normal(0, np.radians(settings.local_std_deg), (n_local, 4))
    s = (np.arange(n_line) + rng.random(n_line)) / n_line  # stratified
    along = line[0] + s[:, None] * (line[1] - line[0])
    if digit > 0:
        along[:, 1] = here[1]  # a line says nothing of the spread
    along += rng.normal(0, np.radians(settings.line_std_deg), (n_line, 4))
    limits = LIMITS[4 * digit : 4 * digit + 4]
    return np.clip(np.vstack([local, along]), limits[:, 0], limits[:, 1])


def sweep(
    refiner: Refiner,
    view: View,
    pose: Pose,
    theta: Array,
    prior: Prior,
    lines: Array,
    settings: SweepSettings,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Best angles ``(20,)`` after one sweep, and the candidates' energies ``(5, n)``.

    ``lines`` is ``(5, 2, 4)``. Digits are visited in random order; a candidate replaces the
    digit's angles only where it lowers the energy of the whole hand.
    """
    best = np.array(theta, float)
    contour = refiner.contour(view, pose)
    energies = np.empty((5, settings.samples))
    for digit in rng.permutation(5):
        candidates = propose(best, digit, lines[digit], settings, rng)
        here, energies[digit] = digit_energies(
            digit, candidates, best, np.array(pose.R), np.array(pose.t_mm),
            refiner.sizes, refiner.parts, contour, _maps(view), view.intrinsics,
            refiner.settings.weights(), _prior(prior), refiner.limits,
            np.radians(refiner.settings.limit_std_deg),
        )  # fmt: skip
        k = int(np.argmin(energies[digit]))
        if energies[digit, k] < here:
            best[4 * digit : 4 * digit + 4] = candidates[k]
    return best, energies


@numba.njit(cache=True, nogil=True)
def digit_energies(  # type: ignore[no-untyped-def]
    d, candidates, theta, R, t, sizes, parts, contour, maps, K, weights, prior, limits, limit_std
):
    """Energy of the current angles and of each candidate ``(n,)`` of digit ``d``.

    Only the terms that the digit can change are summed, so values compare with each other only.
    """
    capsules, digit, bone = parts
    n_nodes = len(sizes[4])
    circles = np.empty((n_nodes, 4))
    Jc = np.empty((n_nodes, 3, 10))
    H, g = np.empty((0, 0)), np.empty(0)
    place_nodes(theta, R, t, sizes, K, circles, Jc)
    rest = np.empty(len(contour))
    for m in range(len(contour)):
        rest[m] = nearest_capsule(
            contour[m, :2], contour[m, 2:4], circles, capsules, d, digit
        )[0]  # fmt: skip
    own = np.where(digit == d)[0]
    c2 = weights[1]
    scale = 1.0 / (weights[0] * weights[0])
    angles = theta.copy()
    energies = np.empty(len(candidates) + 1)
    for n in range(len(candidates) + 1):
        if n > 0:
            angles[4 * d : 4 * d + 4] = candidates[n - 1]
            place_nodes(angles, R, t, sizes, K, circles, Jc)
        e = 0.0
        for m in range(len(contour)):
            if contour[m, 4] <= 0:
                continue
            near = nearest_capsule(
                contour[m, :2], contour[m, 2:4], circles, capsules[own], -9, digit[own]
            )[0]  # fmt: skip
            e += contour[m, 4] * rho(min(near, rest[m]), c2)
        for c in own:
            e += sample_energy(c, circles, capsules, digit, bone, maps, weights, Jc, H, g)
        energies[n] = e * scale + prior_energy(R, t, angles, prior, limits, limit_std, H, g)
    return energies[0], energies[1:]
