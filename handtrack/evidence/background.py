"""The place behind the hand: a running mean of each pixel while the camera stands still.

Two ways to know what a pixel looks like without the hand:

- :class:`Background`: mean and variance over the frames in which the hand was elsewhere, at most
  640 px on the long side. A change of the light (exposure, white balance) is followed by a gain for
  each channel (von Kries); when most of the picture changes otherwise the camera has moved, and
  everything is forgotten.
- :func:`smooth_backdrop`: from a single frame, a quadratic in x and y fitted robustly to the
  picture's border. It is as good as a photograph of the backdrop where that is plain, whatever
  colour the hand has, and its residual says when it is not.

>>> frame = np.full((48, 64, 3), 90, np.uint8)
>>> backdrop, sigma = smooth_backdrop(frame)
>>> float(np.abs(backdrop - 90).max()) < 0.1, sigma < 2.1
(True, True)
"""

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Window
from handtrack.evidence.colour import largest_channel

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

LONG_SIDE_PX = 640
#: A pixel is known after this many frames, and its mean then follows at the inverse of MEMORY.
KNOWN_FRAMES = 4.0
MEMORY_FRAMES = 60.0
#: A backdrop whose border scatters by more levels than this is not plain.
PLAIN_SIGMA = 6.0
#: Share of the known picture that must change at once for the camera to have moved.
MOVED_SHARE = 0.4
#: A change of the light is the same nearly everywhere: this share of the known picture is within
#: so much of the median change.
SAME_LIGHT, LIGHT_SCATTER = 0.6, 0.12
#: Gains that one frame can bring, and the smallest that is followed.
MOST_LIGHT, LEAST_LIGHT = 1.4, 0.01
#: Levels between which a channel tells a gain: neither noise nor clipped.
TELLING = (24, 240)


def shrink(rgb: Pixels, long_side_px: int) -> Pixels:
    """``rgb`` with at most ``long_side_px`` on its long side, averaged over areas."""
    h, w = rgb.shape[:2]
    if max(h, w) > 3 * long_side_px:  # most of a very large frame need not be read
        step = max(h, w) // (2 * long_side_px)
        rgb = rgb[::step, ::step]
    factor = long_side_px / max(h, w)
    if factor >= 1:
        return rgb
    size = (max(1, round(w * factor)), max(1, round(h * factor)))
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


class Background:
    """Running mean and variance of the picture behind the hand.

    Attributes
    ----------
    mean : (h, w, 3) float32
        RGB.
    variance : (h, w) float32
        Of one channel, noise and flicker together.
    age : (h, w) float32
        Frames seen, at most ``MEMORY_FRAMES``; below ``KNOWN_FRAMES`` the pixel is not known.
    light : (3,) float32
        How much brighter red, green and blue have become since the first frame.
    """

    def __init__(self) -> None:
        self.mean: Float = np.zeros((0, 0, 3), np.float32)
        self.variance: Float = np.zeros((0, 0), np.float32)
        self.age: Float = np.zeros((0, 0), np.float32)
        self.light: Float = np.ones(3, np.float32)
        self.frame_width_px = 0
        self._seen: Float | None = None  # mean and deviation, as through() wants them

    @property
    def known(self) -> Mask:
        """Where the background is known, ``(h, w)``."""
        return self.age >= KNOWN_FRAMES

    @property
    def scale(self) -> float:
        """Background pixels per frame pixel."""
        return self.mean.shape[1] / max(self.frame_width_px, 1)

    def watch(self, frame_rgb: Pixels, hand: Mask | None = None) -> None:
        """Take in a frame, but not where the ``hand`` ``(H, W)`` is (nowhere if None)."""
        small = shrink(frame_rgb, LONG_SIDE_PX)
        self._fit_to(small, frame_rgb.shape[1])
        h, w = small.shape[:2]
        covered = np.zeros((h, w), np.uint8) if hand is None else self._resized(hand)
        self.relight(frame_rgb)
        if self._camera_moved(small, covered):
            self.age[:] = 0
        self._seen = None
        update_kernel(small, covered, self.mean, self.variance, self.age, MEMORY_FRAMES)

    def relight(self, frame_rgb: Pixels) -> None:
        """Follow a change of exposure or white balance, told by what is known of the background.

        The hand need not be masked: the median over everything is taken twice, the second time of
        what is near the first. Nothing is done where the picture does not change as one.
        """
        gain = self._gain_to(frame_rgb)
        if gain is not None and np.abs(gain - 1).max() > LEAST_LIGHT:
            self.mean *= gain
            self.light = self.light * gain
            self._seen = None

    def forget(self, hand: Mask) -> None:
        """The ``hand`` ``(H, W)`` was standing here: what was learned there is not background."""
        if self.mean.size:
            self.age[self._resized(hand) > 0] = 0
            self._seen = None

    def assume(self, frame_rgb: Pixels, hand: Mask) -> None:
        """Take the smooth backdrop of one frame for known, if the frame has one.

        Parameters
        ----------
        frame_rgb : (H, W, 3)
            The frame.
        hand : (H, W)
            Where the hand is; there the backdrop is carried over from the border. Elsewhere it is
            taken only where the frame agrees with it. What was seen before is kept.
        """
        small = shrink(frame_rgb, LONG_SIDE_PX)
        tiny = shrink(frame_rgb, LONG_SIDE_PX // 4)
        backdrop, sigma = smooth_backdrop(tiny)
        if sigma > PLAIN_SIGMA:
            return
        self._fit_to(small, frame_rgb.shape[1])
        wide = np.asarray(cv2.resize(backdrop, small.shape[1::-1]), np.float32)
        distance = largest_channel(np.abs(small - wide))
        covered = self._resized(hand) > 0
        agrees = distance < 4 * sigma
        if not covered.any() or np.median(distance[covered]) < 5 * sigma:
            return  # the hand is too much like it
        new = (self.age < KNOWN_FRAMES) & (agrees | covered)
        self.mean[new] = wide[new]
        self.variance[new] = (1.5 * sigma) ** 2
        self.age[new] = KNOWN_FRAMES
        self._seen = None

    def through(self, window: Window) -> Float:
        """RGB mean and standard deviation ``(h, w, 4)``, the latter 1e6 where not known."""
        if self._seen is None:
            self._seen = np.empty((*self.mean.shape[:2], 4), np.float32)
            seen_kernel(self.mean, self.variance, self.age, self._seen)
        s = self.scale
        A = np.array(
            [
                [s / window.scale, 0, (window.x_px + 0.5) * s - 0.5],
                [0, s / window.scale, (window.y_px + 0.5) * s - 0.5],
            ]
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = (window.width_px, window.height_px)
        outside = (0.0, 0.0, 0.0, 1e6)
        return np.asarray(cv2.warpAffine(self._seen, A, size, flags=flags, borderValue=outside))

    def difference(self, frame_rgb: Pixels) -> Float | None:
        """Distance to the background in standard deviations, at its size; None if unknown."""
        if not self.mean.size or self.known.mean() < 0.5:
            return None
        small = cv2.resize(shrink(frame_rgb, LONG_SIDE_PX), self.mean.shape[1::-1])
        d = np.linalg.norm(small - self.mean, axis=-1) / (np.sqrt(self.variance) + 4.0)
        return np.where(self.known, d, 0).astype(np.float32)

    def mirrored(self) -> "Background":
        """The background of the frame flipped left to right."""
        other = Background()
        other.mean = self.mean[:, ::-1].copy()
        other.variance = self.variance[:, ::-1].copy()
        other.age = self.age[:, ::-1].copy()
        other.light = self.light.copy()
        other.frame_width_px = self.frame_width_px
        return other

    def _fit_to(self, small: Pixels, frame_width_px: int) -> None:
        """Start afresh if frames have another size than so far."""
        if self.mean.shape != small.shape or self.frame_width_px != frame_width_px:
            self.mean = small.astype(np.float32)
            self.variance = np.full(small.shape[:2], 64.0, np.float32)
            self.age = np.zeros(small.shape[:2], np.float32)
            self.frame_width_px = frame_width_px

    def _resized(self, mask: Mask) -> NDArray[np.uint8]:
        size = self.mean.shape[1::-1]
        small = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_AREA)
        grown = cv2.dilate(small, np.ones((9, 9), np.uint8))
        return np.asarray(grown, np.uint8)

    def _gain_to(self, frame_rgb: Pixels) -> Float | None:
        """Gain ``(3,)`` from the mean to a frame, None where it cannot be told."""
        h, w = self.age.shape
        if frame_rgb.shape[1] != self.frame_width_px:
            return None
        i, j = np.mgrid[8:h:16, 8:w:16]
        seen = self.age[i, j] > 0
        i, j = i[seen], j[seen]
        H, W = frame_rgb.shape[:2]
        now = frame_rgb[(2 * i + 1) * H // (2 * h), (2 * j + 1) * W // (2 * w)].astype(np.float32)
        before = self.mean[i, j]
        low, high = TELLING
        tells = ((now > low) & (now < high) & (before > low) & (before < high)).all(axis=1)
        if tells.sum() < 50:
            return None
        ratio = now[tells] / before[tells]
        near = (np.abs(ratio / np.median(ratio, axis=0) - 1) < LIGHT_SCATTER).all(axis=1)
        if near.mean() < SAME_LIGHT:
            return None
        gain = np.asarray(np.median(ratio[near], axis=0), np.float32)
        return gain if np.all((gain < MOST_LIGHT) & (gain * MOST_LIGHT > 1)) else None

    def _camera_moved(self, small: Pixels, covered: NDArray[np.uint8]) -> bool:
        known, changed = changed_kernel(small, covered, self.mean, self.variance, self.age)
        return bool(known >= 50 and changed > MOVED_SHARE * known)


@numba.njit(cache=True, nogil=True)
def changed_kernel(rgb, covered, mean, variance, age):  # type: ignore[no-untyped-def]
    """How many pixels of a grid are known and not covered, and how many of those look changed."""
    known, changed = 0, 0
    for i in range(0, mean.shape[0], 4):
        for j in range(0, mean.shape[1], 4):
            if covered[i, j] or age[i, j] < KNOWN_FRAMES:
                continue
            known += 1
            far = np.float32(0.0)
            for c in range(3):
                far = max(far, abs(rgb[i, j, c] - mean[i, j, c]))
            changed += far > 12 + 3 * np.sqrt(variance[i, j])
    return known, changed


@numba.njit(cache=True, nogil=True)
def seen_kernel(mean, variance, age, seen):  # type: ignore[no-untyped-def]
    """Fill ``seen`` ``(h, w, 4)`` with mean and standard deviation, 1e6 where not known."""
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            for c in range(3):
                seen[i, j, c] = mean[i, j, c]
            known = age[i, j] >= KNOWN_FRAMES
            seen[i, j, 3] = np.sqrt(variance[i, j]) + np.float32(2.0) if known else 1e6


@numba.njit(cache=True, nogil=True, fastmath=True)
def update_kernel(rgb, covered, mean, variance, age, memory):  # type: ignore[no-untyped-def]
    """One step of the running mean and variance where nothing covers the pixel."""
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            if covered[i, j]:
                continue
            n = age[i, j]
            rate = np.float32(1.0) / (n + np.float32(1.0))
            square = np.float32(0.0)
            for c in range(3):
                d = rgb[i, j, c] - mean[i, j, c]
                square += d * d
                mean[i, j, c] += rate * d
            if n > 0:
                change = min(square / np.float32(3.0), np.float32(900.0))
                variance[i, j] += max(rate, np.float32(0.05)) * (change - variance[i, j])
            age[i, j] = min(n + 1, memory)


def smooth_backdrop(rgb: Pixels, border_share: float = 0.06) -> tuple[Float, float]:
    """Quadratic fitted to the border of ``rgb``, and the scatter of the border about it.

    Parameters
    ----------
    rgb : (h, w, 3)
        A small picture; its four borders, ``border_share`` of the short side wide, are used.

    Returns
    -------
    backdrop : (h, w, 3) float32
        What each pixel would look like without anything in front.
    sigma : float
        Robust standard deviation of the better 70 % of the border, at least 2 levels.
    """
    h, w = rgb.shape[:2]
    band = max(2, round(border_share * min(h, w)))
    y, x = np.mgrid[-1 : 1 : h * 1j, -1 : 1 : w * 1j].astype(np.float32)
    terms = np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=-1)  # (h, w, 6)
    border = np.ones((h, w), bool)
    border[band : h - band, band : w - band] = False
    T, colour = terms[border], rgb[border].astype(np.float32)
    weight = np.ones(len(T), np.float32)
    for _ in range(8):
        TW = T * weight[:, None]
        coefficients = np.linalg.solve(TW.T @ T + 1e-3 * np.eye(6, dtype=np.float32), TW.T @ colour)
        r = np.linalg.norm(colour - T @ coefficients, axis=-1)
        scale = max(1.5 * float(np.median(r)), 3.0)
        weight = 1 / (1 + (r / scale) ** 4)
    sigma = max(2.0, float(np.quantile(r, 0.7)))
    return (terms @ coefficients).astype(np.float32), sigma
