"""Levenberg-Marquardt over the palm pose and the 20 angles, the manifold as a prior.

No sampling here: it slides into the nearest minimum of :mod:`handtrack.refine.residuals`, so what
it starts from (prediction, sweeps of the fingers, seeds of a restart) decides which.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.hand.capsules import CapsuleHand
from handtrack.hand.skeleton import LIMITS
from handtrack.records import Pose, freeze_arrays
from handtrack.refine.prior import Prior, prior_energy
from handtrack.refine.residuals import image_energy, place_nodes
from handtrack.refine.view import View

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RefineSettings:
    """Weights of the energy; pixels are those of the window, where a palm is about 72 px long."""

    sigma_px: float = 3.0
    """Standard deviation of one residual, neighbours' correlation included; of a doubtful view
    that times its doubt."""
    robust_px: float = 6.0
    """Scale of the robust function."""
    silhouette_weight: float = 0.5
    """Weight of outline samples against the silhouette."""
    internal_weight: float = 0.3
    """Weight of a finger's outline before the hand against the edges there."""
    inner_weight: float = 0.15
    """Weight of the edges inside the silhouette against the fingers' outlines."""
    reach_px: int = 8
    """How far along its normal a sample looks for an edge."""
    limit_std_deg: float = 3.0
    """Softness of the joint limits."""
    wrist_line_mm: float = 6.0
    """The evidence stops this far above the wrist."""

    def weights(self, doubt: float) -> Array:
        """The numbers the kernels take: sigma, c^2, silhouette, internal, reach."""
        return np.array(
            [
                self.sigma_px * doubt,
                self.robust_px**2,
                self.silhouette_weight,
                self.internal_weight,
                self.reach_px,
            ]
        )


@dataclass(frozen=True, eq=False)
class Refined:
    """Where a refinement ended: estimate, energy (and its image part), information matrix."""

    pose: Pose
    theta: Array  # (20,)
    energy: float
    image_energy: float
    information: Array  # (26, 26), of (w, v, theta)
    iterations: int

    def __post_init__(self) -> None:
        freeze_arrays(self)


class Refiner:
    """Refinement for one hand shape; holds the flat arrays the kernels want."""

    def __init__(self, hand: CapsuleHand, settings: RefineSettings) -> None:
        self.hand, self.settings = hand, settings
        shape = hand.shape
        self.sizes = (
            np.array(shape.base_mm),
            np.array(hand.rest),
            np.array(shape.length_mm),
            hand.node_from,
            hand.node_weight,
            hand.node_offset,
            hand.node_radius_mm,
            hand.node_digit,
        )
        self.parts = (hand.capsule_node, hand.capsule_digit, hand.capsule_bone)
        self.limits = np.array(LIMITS)

    def weigh(self, view: View, pose: Pose, theta: Array, prior: Prior) -> tuple[float, float]:
        """Image energy and whole energy of a hand as it is."""
        image, whole = total_energy(
            np.array(pose.R), np.array(pose.t_mm), np.array(theta, float),
            self.sizes, self.parts, self.contour(view, pose), self.inner(view, pose),
            view.maps, view.intrinsics,
            self.settings.weights(view.doubt), prior.arrays, self.limits,
            np.radians(self.settings.limit_std_deg), np.empty((0, 0)), np.empty(0),
        )  # fmt: skip
        return float(image), float(whole)

    def contour(self, view: View, pose: Pose) -> Array:
        """Contour points with weights ``(m, 5)`` as the kernels take them."""
        return view.weighted(view.outline, pose, self.settings.wrist_line_mm)

    def inner(self, view: View, pose: Pose) -> Array:
        """Edges inside the silhouette ``(k, 5)`` as the kernels take them."""
        edges = view.weighted(view.inner, pose, self.settings.wrist_line_mm)
        edges[:, 4] *= self.settings.inner_weight
        return edges

    def __call__(
        self, view: View, pose: Pose, theta: Array, prior: Prior, steps: int, free: str = "all"
    ) -> Refined:
        """Refine from ``pose`` and ``theta`` ``(20,)``, ``free`` being "all", "palm" or "fingers".

        Returns
        -------
        Refined
            Never worse than the start, in energy.
        """
        mask = np.ones(26, dtype=np.bool_)
        if free == "palm":
            mask[6:] = False
        elif free == "fingers":
            mask[:6] = False
        R, t, angles, energy, image, H, iterations = levenberg_marquardt(
            np.array(pose.R), np.array(pose.t_mm), np.array(theta, float),
            self.sizes, self.parts, self.contour(view, pose), self.inner(view, pose),
            view.maps, view.intrinsics,
            self.settings.weights(view.doubt), prior.arrays, self.limits,
            np.radians(self.settings.limit_std_deg), mask, steps,
        )  # fmt: skip
        return Refined(Pose(R, t), angles, energy, image, H, iterations)


@numba.njit(cache=True, nogil=True)
def so3_exp(w):  # type: ignore[no-untyped-def]
    """Rodrigues' formula for a rotation vector ``(3,)``."""
    a2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    a = np.sqrt(a2)
    s = 1.0 - a2 / 6.0 if a < 1e-4 else np.sin(a) / a
    c = 0.5 - a2 / 24.0 if a < 1e-4 else (1.0 - np.cos(a)) / a2
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + s * W + c * (W @ W)


@numba.njit(cache=True, nogil=True)
def total_energy(  # type: ignore[no-untyped-def]
    R, t, theta, sizes, parts, contour, inner, maps, K, weights, prior, limits, limit_std, H, g
):
    """Image part and whole of ``E``; fills ``H`` and ``g`` (zeros on entry) unless empty."""
    n = len(sizes[4])
    circles = np.empty((n, 4))
    Jc = np.empty((n, 3, 10))
    place_nodes(theta, R, t, sizes, K, circles, Jc)
    image = image_energy(
        circles, parts[0], parts[1], parts[2], contour, inner, maps, weights, Jc, H, g
    )
    return image, image + prior_energy(R, t, theta, prior, limits, limit_std, H, g)


@numba.njit(cache=True, nogil=True)
def levenberg_marquardt(  # type: ignore[no-untyped-def]
    R,
    t,
    theta,
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
    free,
    steps,
):
    """At most ``steps`` damped Gauss-Newton steps; the damping is Marquardt's."""
    H, g = np.zeros((26, 26)), np.zeros(26)
    H1, g1 = np.empty((26, 26)), np.empty(26)
    image, energy = total_energy(
        R, t, theta, sizes, parts, contour, inner, maps, K, weights, prior, limits, limit_std, H, g
    )
    damping, done = 1e-2, 0
    for step in range(steps):
        done = step + 1
        A, b = H.copy(), g.copy()
        for i in range(26):
            A[i, i] += damping * max(H[i, i], 1e-6)
            if not free[i]:
                A[i, :] = 0.0
                A[:, i] = 0.0
                A[i, i] = 1.0
                b[i] = 0.0
        x = -np.linalg.solve(A, b)
        R1, t1, theta1 = so3_exp(x[:3]) @ R, t + x[3:6], theta + x[6:]
        # most steps are taken, so their system is worked out at once
        H1[:], g1[:] = 0.0, 0.0
        image1, energy1 = total_energy(
            R1, t1, theta1, sizes, parts, contour, inner, maps, K, weights,
            prior, limits, limit_std, H1, g1,
        )  # fmt: skip
        if energy1 < energy:
            small = energy - energy1 < 1e-3 * energy
            R, t, theta, image, energy = R1, t1, theta1, image1, energy1
            H, H1, g, g1 = H1, H, g1, g
            damping = max(damping * 0.3, 1e-5)
            if small:
                break
        else:
            damping *= 6.0
            if damping > 1e6:
                break
    return R, t, theta, energy, image, H, done
