"""How well a configuration explains a frame: edges and silhouette (paper, Section 4.2).

Edges. From each sample on a patch's lateral side a line is searched along the normal. With edges at
offsets ``z_m`` and Poisson clutter of density ``lambda``, missing with probability ``q``::

    p(z | x) = q + (1 - q) / (sqrt(2 pi) sigma lambda) sum_m exp(-z_m^2 / (2 sigma^2))

in units of what clutter alone would give. Samples hidden behind a nearer patch do not vote (the
occlusion map), that is, their share is 1: so a sample that should be seen and is not counts
against the configuration, and showing many sides is no merit in itself.

Silhouette. ``area``, the paper's term, compares bare areas and cannot tell a hand from its shifted
copy; ``xor`` compares where they differ. A product over hundreds of dependent points is far too
peaked, so the filter tempers the sum of both.
"""

from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.fingers.raster import polygon_areas
from handtrack.fingers.silhouette import SilhouetteBits, forearm_strip
from handtrack.hand.surface import Patches, Surface
from handtrack.records import Pose
from handtrack.refine.view import View

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LikelihoodSettings:
    """The two terms and their scales."""

    silhouette: Literal["xor", "area"] = "xor"
    """Compare silhouettes by where they differ, or by bare area as the paper does."""
    edge_sigma_px: float = 2.5
    """Standard deviation of an edge's offset, in pixels of the window."""
    reach_px: int = 8
    """Half length of the measurement lines."""
    missing: float = 0.2
    """Probability q that a true edge is not found."""
    clutter_per_px: float = 0.06
    """Density lambda of clutter along a measurement line."""
    silhouette_std: float = 0.004
    """Scale of the silhouettes' difference, as a share of the hand's area."""


def edge_term(patches: Patches, view: View, settings: LikelihoodSettings) -> Array:
    """Sum over visible lateral samples of ``log p(z | x)``, ``(n,)``."""
    gain = (1 - settings.missing) / (
        np.sqrt(2 * np.pi) * settings.edge_sigma_px * settings.missing * settings.clutter_per_px
    )
    out = np.empty(len(patches.corners))
    _edges(
        patches.corners, patches.depth_mm, patches.sample, patches.normal, patches.sample_patch,
        patches.digit, patches.bone, view.edge_strength, view.edge_x, view.edge_y, view.valid,
        settings.edge_sigma_px, settings.reach_px, settings.missing, gain, out,
    )  # fmt: skip
    return out


def silhouette_term(
    patches: Patches, bits: SilhouetteBits, below: Array, settings: LikelihoodSettings
) -> Array:
    """Laplacian in the difference of the silhouettes, relative to the hand's area, ``(n,)``.

    ``below`` ``(4, 2)`` is the forearm's part of the image, which does not count.
    """
    counts = np.empty((len(patches.corners), 3))
    polygon_areas(patches.corners, below, bits.scale, bits.hand, bits.outside, counts)
    seen = np.maximum(counts[:, 2], 1.0)
    differ = counts[:, 1] if settings.silhouette == "xor" else np.abs(counts[:, 0] - counts[:, 2])
    return -(differ / seen) / settings.silhouette_std


class FingerLikelihood:
    """``log p(z | theta)`` for angles ``(n, 20)`` at one palm pose in one frame."""

    def __init__(
        self,
        surface: Surface,
        view: View,
        pose: Pose,
        settings: LikelihoodSettings,
        wrist_y_mm: float = 6.0,
        wrist_radius_mm: float = 26.0,
    ) -> None:
        self.surface, self.view, self.pose, self.settings = surface, view, pose, settings
        self.bits = SilhouetteBits.of(view)
        self.below = forearm_strip(
            pose.R[None], pose.t_mm[None], view.intrinsics, self.bits, wrist_y_mm, wrist_radius_mm
        )[0]

    def __call__(self, theta: Array) -> Array:
        """Log-likelihood ``(n,)``; large batches are worked off in parts of bounded memory."""
        parts = np.array_split(theta, max(1, len(theta) // 256))
        return np.concatenate([self._of_part(part) for part in parts])

    def _of_part(self, theta: Array) -> Array:
        patches = self.surface.patches(theta, self.pose, self.view.intrinsics)
        return edge_term(patches, self.view, self.settings) + silhouette_term(
            patches, self.bits, self.below, self.settings
        )


@numba.njit(cache=True, nogil=True)
def _inside(x, y, corners):  # type: ignore[no-untyped-def]
    """Whether a point lies inside a convex polygon ``(V, 2)`` of either orientation."""
    low, high = 0.0, 0.0
    for a in range(len(corners)):
        b = a + 1 if a + 1 < len(corners) else 0
        cross = (corners[b, 0] - corners[a, 0]) * (y - corners[a, 1]) - (
            corners[b, 1] - corners[a, 1]
        ) * (x - corners[a, 0])
        low, high = min(low, cross), max(high, cross)
    return low > -1e-9 or high < 1e-9


@numba.njit(cache=True, nogil=True)
def hidden(x, y, own, corners, depth, digit, bone):  # type: ignore[no-untyped-def]
    """Whether a sample is covered by a nearer patch, or runs inside the same piece of skin."""
    for p in range(len(corners)):
        if p == own:
            continue
        joined = digit[p] == digit[own] and abs(bone[p] - bone[own]) <= 1
        if (joined or depth[p] < depth[own]) and _inside(x, y, corners[p]):
            return True
    return False


@numba.njit(cache=True, nogil=True)
def _edges(  # type: ignore[no-untyped-def]
    corners, depth, sample, normal, sample_patch, digit, bone,
    strength, edge_x, edge_y, valid, sigma, reach, missing, gain, out,
):  # fmt: skip
    kernel = np.exp(-0.5 * (np.arange(reach + 1) / sigma) ** 2)
    for n in range(len(corners)):
        total = 0.0
        for s in range(sample.shape[1]):
            x, y = sample[n, s, 0], sample[n, s, 1]
            nx, ny = normal[n, s, 0], normal[n, s, 1]
            if x < valid[0] or y < valid[1] or x > valid[2] - 1 or y > valid[3] - 1:
                continue
            if hidden(x, y, sample_patch[s], corners[n], depth[n], digit, bone):
                continue
            evidence = 0.0
            for k in range(-reach, reach + 1):
                i, j = int(y + k * ny + 0.5), int(x + k * nx + 0.5)
                if i < 0 or j < 0 or i >= strength.shape[0] or j >= strength.shape[1]:
                    continue
                if strength[i, j] > 0.05:
                    along = abs(edge_x[i, j] * nx + edge_y[i, j] * ny)
                    evidence = max(evidence, strength[i, j] * along * along * kernel[abs(k)])
            total += np.log(missing * (1.0 + gain * evidence))
        out[n] = total
