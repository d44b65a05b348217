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
from handtrack.refine.outline import FARTHEST_PX, frame_capsules, nearest_outline
from handtrack.refine.prior import Prior, digit_prior
from handtrack.refine.residuals import place_digit, place_nodes, rho, sample_energy
from handtrack.refine.solve import Refiner
from handtrack.refine.view import View

Array = NDArray[np.float64]
#: A point that the rest of the hand explains to this is no concern of the digit.
EXPLAINED_PX = 0.5
#: Energy above the best so far at which a candidate is given up: it would weigh ``exp(-20)``.
HOPELESS = 40.0


@dataclass(frozen=True)
class SweepSettings:
    """How many samples a digit gets, and where they are drawn."""

    samples: int = 30
    """Samples for each digit."""
    near_share: float = 0.35
    """Share drawn around the current angles."""
    line_share: float = 0.25
    """Share along the line; the rest covers the digit's range."""
    near_std_deg: float = 12.0
    """Spread around the current angles."""
    line_std_deg: float = 7.0
    """Spread off the line, and about the usual spread of the fingers."""


#: In a free finger the last joint flexes about this share of the middle one.
DIP_SHARE = 0.6


def propose(
    theta: Array, digit: int, line: Array, settings: SweepSettings, rng: np.random.Generator
) -> Array:
    """Candidates ``(n, 4)`` for a digit; ``line`` ``(2, 4)`` is its extended and curled state."""
    n_near = round(settings.samples * settings.near_share)
    n_line = round(settings.samples * settings.line_share)
    n_range = settings.samples - n_near - n_line
    here = theta[4 * digit : 4 * digit + 4]
    limits = LIMITS[4 * digit : 4 * digit + 4]
    off = np.radians(settings.line_std_deg)
    near = here + rng.normal(0, np.radians(settings.near_std_deg), (n_near, 4))
    along = line[0] + stratified(n_line, 1, rng) * (line[1] - line[0])
    u = stratified(n_range, 2, rng)
    free = limits[:, 0] + rng.random((n_range, 4)) * (limits[:, 1] - limits[:, 0])
    if digit > 0:
        free[:, 0] = limits[0, 0] + u[:, 0] * (limits[0, 1] - limits[0, 0])
        free[:, 2] = limits[2, 0] + u[:, 1] * (limits[2, 1] - limits[2, 0])
        free[:, 3] = DIP_SHARE * free[:, 2]
        free[:, 1] = line[:, 1].mean()
        for part in (along, free):  # the spread stays, or falls back to the usual
            part[::2, 1] = here[1]
    along += rng.normal(0, off, along.shape)
    free += rng.normal(0, off, free.shape)
    return np.clip(np.vstack([near, along, free]), limits[:, 0], limits[:, 1])


def stratified(n: int, dimensions: int, rng: np.random.Generator) -> Array:
    """Uniform samples ``(n, dimensions)``, one in each of ``n`` equal slices of every axis."""
    slices = rng.permuted(np.tile(np.arange(n), (dimensions, 1)), axis=1).T
    return np.asarray((slices + rng.random((n, dimensions))) / max(n, 1))


def sweep(
    refiner: Refiner,
    view: View,
    pose: Pose,
    theta: Array,
    prior: Prior,
    lines: Array,
    settings: SweepSettings,
    rng: np.random.Generator,
    tried: Array | None = None,
) -> tuple[Array, Array]:
    """Best angles ``(20,)`` after one sweep, and the candidates' energies ``(5, n)``.

    ``lines`` is ``(5, 2, 4)``. Digits are visited in random order; a candidate replaces the
    digit's angles only where it lowers the energy of the whole hand. ``tried`` ``(5, n, 20)``, if
    given, is filled with the whole hands that were weighed.
    """
    best = np.array(theta, float)
    contour, inner = refiner.contour(view, pose), refiner.inner(view, pose)
    energies = np.empty((5, settings.samples))
    for digit in rng.permutation(5):
        candidates = propose(best, digit, lines[digit], settings, rng)
        if tried is not None:
            tried[digit] = best
            tried[digit, :, 4 * digit : 4 * digit + 4] = candidates
        here, energies[digit] = digit_energies(
            digit, candidates, best, np.array(pose.R), np.array(pose.t_mm),
            refiner.sizes, refiner.parts, contour, inner, view.maps, view.intrinsics,
            refiner.settings.weights(view.doubt), prior.arrays, refiner.limits,
            np.radians(refiner.settings.limit_std_deg),
        )  # fmt: skip
        k = int(np.argmin(energies[digit]))
        if energies[digit, k] < here:
            best[4 * digit : 4 * digit + 4] = candidates[k]
    return best, energies


@numba.njit(cache=True, nogil=True)
def digit_energies(  # type: ignore[no-untyped-def]
    d,
    candidates,
    theta,
    R,
    t,
    sizes,
    parts,
    contour,
    inner,
    maps,
    K,
    weights,
    prior,
    limits,
    limit_std,
):
    """Energy of the current angles and of each candidate ``(n,)`` of digit ``d``.

    Only the terms that the digit can change are summed, so values compare with each other only. A
    candidate that is ``HOPELESS`` keeps what had been summed by then.
    """
    capsules, digit, bone = parts
    n_nodes, n_capsules = len(sizes[4]), len(capsules)
    circles = np.empty((n_nodes, 4))
    Jc = np.empty((n_nodes, 3, 10))
    frames = np.empty((n_capsules, 12))
    H, g = np.empty((0, 0)), np.empty(0)
    place_nodes(theta, R, t, sizes, K, circles, Jc)
    frame_capsules(circles, capsules, frames)
    every, own = np.arange(n_capsules), np.where(digit == d)[0]
    # what the rest of the hand explains to half a pixel, this digit need not
    points = np.concatenate((contour, inner))
    rest = np.empty(len(points))
    for k in range(len(points)):
        facing = k < len(contour)
        far = nearest_outline(points[k], facing, every, d, digit, frames, FARTHEST_PX)[0]
        rest[k] = far if facing else abs(far)
    still = np.where((np.abs(rest) > EXPLAINED_PX) & (points[:, 4] > 0))[0]
    c2 = weights[1]
    scale = 1.0 / (weights[0] * weights[0])
    angles = theta.copy().reshape(1, 20)
    energies, least = np.empty(len(candidates) + 1), np.inf
    for n in range(len(candidates) + 1):
        if n > 0:
            angles[0, 4 * d : 4 * d + 4] = candidates[n - 1]
            place_digit(angles, d, R, t, sizes, K, circles)
            frame_capsules(circles, capsules, frames)
        e = digit_prior(d, angles[0], prior, limits, limit_std, H, g)
        for c in own:
            e += scale * sample_energy(
                c, circles, capsules, digit, bone, frames, maps, weights, Jc, H, g
            )  # fmt: skip
        for k in still:
            if e > least + HOPELESS:
                break
            facing = k < len(contour)
            far = nearest_outline(points[k], facing, own, -9, digit, frames, rest[k])[0]
            e += scale * points[k, 4] * rho(far, c2)
        energies[n], least = e, min(e, least)
    return energies[0], energies[1:]
