"""The silhouette as a probability: is this pixel hand (or bare forearm)?

Two cues meet in one ratio of densities over colour ``x`` at pixel ``p``::

    P(hand | x, p) = f(x) / (f(x) + b(x, p))
    b(x, p) = (1 - w) b(x) + w [ N(x; mu_p, sigma_p^2) + shadow(x; mu_p) ]

``f`` and ``b`` are what :class:`~handtrack.evidence.colour.ColourModel` learned from this clip;
``mu_p`` is what :class:`~handtrack.evidence.background.Background` saw here without the hand
(``w = 0`` where it saw nothing, or the camera moves); ``shadow`` is that colour dimmed along its
own ray towards black. Skin-like wood is then background where it is known to stand, and a
shadow on the wall stays wall. Where colours alone take too much of one for the other, the log odds
of the :mod:`~handtrack.evidence.shape_cue` are added to theirs, which then count for what they are
worth by the shape cue: before a face the colours of a hand are sure of much that is wrong.

A :class:`Segmenter` belongs to one clip and learns: :meth:`Segmenter.learn` the colours, from
masks of which the tracker is sure, and :meth:`Segmenter.watch` the background. Both are slow.

>>> picture = np.full((120, 160, 3), 60, np.uint8)
>>> picture[30:90, 50:110] = (210, 150, 130)
>>> best = Segmenter.bootstrap(picture)[0]
>>> segmenter = Segmenter.from_mask(picture, best.mask)
>>> P = segmenter.probability(picture)
>>> bool(P[60, 80] > 0.95), bool(P[10, 10] < 0.05)
(True, True)
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Window
from handtrack.evidence import shape_cue
from handtrack.evidence.background import Background, shrink
from handtrack.evidence.candidates import LONG_SIDE_PX, Candidate, find_candidates, ranked
from handtrack.evidence.colour import ColourModel, brightened
from handtrack.evidence.odds import MOST, log_odds_image
from handtrack.evidence.worth import contradicted, near, need_help, worth_of

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

#: Share of shadows in what is expected of a known background.
SHADOW_SHARE = 0.05
#: What is joined to the hand by colour and more of the frame than this is a table, no forearm.
MOST_COVERED = 0.5
#: Scales at which the shape cue then sees the picture; its answers are averaged.
SHAPE_SCALES = (0.5, 0.75)
#: Where shadows would swallow more of the first silhouette than this, there are none.
MOST_SHADOW = 0.03


@dataclass(frozen=True)
class SegmenterSettings:
    """How fast the segmenter follows the clip."""

    colour_rate: float = 0.1
    """Share of each learned frame in the running colours."""
    learn_every: int = 4
    """The colours take in one frame of so many."""
    watch_every: int = 4
    """The background takes in one frame of so many."""


class Segmenter:
    """What hand and background look like in this clip.

    Parameters
    ----------
    colours : ColourModel
        Learned from a first silhouette, see :meth:`from_mask`.
    background : Background or None
        What was seen before the hand came; a fresh one if None.
    by_shape : bool
        Colours cannot tell hand and background apart: the shape cue helps them.
    worth : float
        Share of the log odds by colours that counts beside the shape cue.
    """

    def __init__(
        self,
        colours: ColourModel,
        background: Background | None = None,
        settings: SegmenterSettings | None = None,
        by_shape: bool = False,
        worth: float = 1.0,
    ) -> None:
        self.colours, self.by_shape, self.worth = colours, by_shape, worth
        self.background = Background() if background is None else background
        self.settings = SegmenterSettings() if settings is None else settings
        self._first_light = self.background.light
        self._watched = 0
        self._learned = 0

    @staticmethod
    def bootstrap(frame_rgb: Pixels, background: Background | None = None) -> list[Candidate]:
        """Candidate silhouettes of a whole frame, the most plausible first (may be empty)."""
        return find_candidates(frame_rgb, background)

    @classmethod
    def from_mask(
        cls,
        frame_rgb: Pixels,
        mask: Mask,
        background: Background | None = None,
        shape: Float | None = None,
    ) -> "Segmenter":
        """Learn from a whole frame ``(H, W, 3)`` and a first silhouette in it ``(H, W)``.

        Only the sure parts teach: a rim about the outline is left out, then the silhouette is
        relabelled by what was learned, once, so that a rough mask does. ``shape`` is what
        :func:`seen_by_shape` says of the frame, if it was asked already.
        """
        small = shrink(frame_rgb, LONG_SIDE_PX)
        size = small.shape[1::-1]
        inside = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5
        colours = _learn_colours(small, inside)
        if _shadows_swallow(colours, small, inside):
            colours = _learn_colours(small, inside, shadows=False)
        soft = np.asarray(cv2.GaussianBlur(small, (3, 3), 0), np.uint8)
        odds, shape = colours.log_odds(soft), _by_shape(small) if shape is None else shape
        helped = odds + shape if need_help(odds, shape, inside) else odds
        close = cv2.dilate(inside.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        relabelled = (helped > 0) & close
        if relabelled.sum() > 0.5 * inside.sum():
            inside, colours = relabelled, _learn_colours(small, relabelled, colours.shadows)
        odds = colours.log_odds(soft)
        by_shape = need_help(odds, shape, inside)
        worth = 1.0
        if by_shape:
            close = near(inside)
            worth = worth_of(odds[close], shape[close])
        segmenter = cls(colours, background, by_shape=by_shape, worth=worth)
        segmenter.background.forget(mask)
        segmenter.background.assume(frame_rgb, mask)
        return segmenter

    def find(self, frame_rgb: Pixels) -> list[Candidate]:
        """Candidate silhouettes of a whole frame by what was learned, the most plausible first.

        For a hand that left and returns: a tenth of the time of :meth:`bootstrap`, and surer. Empty
        where nothing large enough looks like the hand that was learned.
        """
        small = shrink(frame_rgb, LONG_SIDE_PX)
        h, w = small.shape[:2]
        scale = w / frame_rgb.shape[1]
        first = 0.5 / scale - 0.5  # frame pixel at which the first small one has its centre
        odds = self.log_odds(small, Window(first, first, scale, w, h))
        return ranked(small, [("learned", odds > 0)], frame_rgb.shape[1::-1])

    def probability(self, rgb: Pixels, window: Window | None = None) -> Float:
        """P(hand or bare forearm) ``(h, w)`` of a crop ``(h, w, 3)``.

        ``window`` says where in the frame the crop lies; without it, colour alone decides.
        """
        return np.asarray(1 / (1 + np.exp(-self.log_odds(rgb, window))), np.float32)

    def log_odds(self, rgb: Pixels, window: Window | None = None) -> Float:
        """Log odds of hand against background ``(h, w)``, clipped (``odds.MOST``)."""
        odds = self._by_colour(rgb, window)
        if not self.by_shape:
            return odds
        return np.clip(self.worth * odds + _by_shape(rgb), -MOST, MOST)

    def reconsider(self, rgb: Pixels, inside: Mask, shape: Float, window: Window) -> None:
        """Ask the shape cue from now on if colours can no longer tell the hand.

        One that began before a wall may pass before a face.

        Parameters
        ----------
        rgb : (h, w, 3)
            The crop that ``window`` shows.
        inside : (h, w)
            What is taken for the hand.
        shape : (m, n)
            Log odds of the crop by the shape cue, of any size.
        """
        if self.by_shape:
            return
        odds = self._by_colour(rgb, window)
        shape = np.asarray(cv2.resize(shape, odds.shape[::-1]), np.float32)
        if contradicted(odds, shape, inside):
            close = near(inside)
            self.by_shape, self.worth = True, worth_of(odds[close], shape[close])

    def _by_colour(self, rgb: Pixels, window: Window | None) -> Float:
        """Log odds ``(h, w)`` by colours and background alone."""
        gain = self.colours.gain
        soft = brightened(np.asarray(cv2.GaussianBlur(rgb, (3, 3), 0.6), np.uint8), gain)
        ycc = np.asarray(cv2.cvtColor(soft, cv2.COLOR_RGB2YCrCb), np.uint8)
        known = window is not None and self.background.known.any()
        local = self.background.through(window) if window is not None and known else None
        shadow = SHADOW_SHARE if self.colours.shadows else 0.0
        brighter = float(np.prod(gain)) ** (1 / 3)
        return log_odds_image(rgb, ycc, self.colours.table, local, shadow, brighter)

    def relight(self, frame_rgb: Pixels) -> None:
        """Follow a change of exposure or white balance since the colours were learned."""
        self.background.relight(frame_rgb)
        self.colours.relight(self.background.light / self._first_light)

    def learn(self, rgb: Pixels, inside: Mask, outside: Mask) -> None:
        """Follow the colours of a crop, slowly.

        Parameters
        ----------
        rgb : (h, w, 3)
            The crop.
        inside, outside : (h, w)
            Pixels that are surely hand, surely background; leave a rim between them. Call it only
            when the fit is trusted.
        """
        self._learned += 1
        if self._learned % self.settings.learn_every:
            return
        few = (slice(None, None, 3), slice(None, None, 3))
        picture = rgb[few]
        self.colours.learn(picture[inside[few]], picture[outside[few]], self.settings.colour_rate)

    def watch(self, frame_rgb: Pixels, hand: Mask, window: Window) -> None:
        """Follow the background of a whole frame where the hand is not.

        Parameters
        ----------
        frame_rgb : (H, W, 3)
            The whole frame.
        hand : (h, w)
            The hand in the ``window``. What is joined to it by its colour (the forearm outside
            the window) is left out too.
        """
        self._watched += 1
        if self._watched % self.settings.watch_every == 1 or self.settings.watch_every == 1:
            self.background.watch(frame_rgb, self._covered(frame_rgb, hand, window))

    def mirrored(self) -> "Segmenter":
        """The segmenter of the clip flipped left to right."""
        return Segmenter(
            self.colours, self.background.mirrored(), self.settings, self.by_shape, self.worth
        )

    def _covered(self, frame_rgb: Pixels, hand: Mask, window: Window) -> Mask:
        """The hand and what is joined to it by colour, at a small size ``(h, w)``."""
        small = shrink(frame_rgb, 160)
        scale = small.shape[1] / frame_rgb.shape[1]
        A = np.array(
            [
                [window.scale / scale, 0, (0.5 / scale - 0.5 - window.x_px) * window.scale],
                [0, window.scale / scale, (0.5 / scale - 0.5 - window.y_px) * window.scale],
            ]
        )
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        seed = cv2.warpAffine(hand.astype(np.uint8), A, small.shape[1::-1], flags=flags) > 0
        alike = (self.colours.log_odds(small) > 0) | seed
        n, labels = cv2.connectedComponents(alike.astype(np.uint8))
        joined = np.zeros(n, bool)
        joined[labels[seed]] = True
        covered = joined[labels]
        return covered if covered.mean() < MOST_COVERED else seed


def seen_by_shape(frame_rgb: Pixels) -> Float:
    """Log odds of hand in a whole frame by the shape cue ``(h, w)``, at the size of candidates."""
    return _by_shape(shrink(frame_rgb, LONG_SIDE_PX))


def _by_shape(rgb: Pixels) -> Float:
    """Log odds ``(h, w)`` of the shape cue, the mean of how it sees the picture at two scales."""
    h, w = rgb.shape[:2]
    answers = []
    for scale in SHAPE_SCALES:
        size = (max(1, round(scale * w)), max(1, round(scale * h)))
        seen = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
        answers.append(shape_cue.log_odds_sized(seen, (w, h)))
    return np.mean(answers, axis=0, dtype=np.float32)


def _shadows_swallow(colours: ColourModel, small: Pixels, inside: Mask) -> bool:
    """Whether much of the hand looks like shaded background (a grey hand before a grey wall)."""
    without = _learn_colours(small, inside, shadows=False)
    lost = (colours.log_odds(small[inside]) < 0) & (without.log_odds(small[inside]) > 0)
    return bool(lost.mean() > MOST_SHADOW)


def _learn_colours(small: Pixels, inside: Mask, shadows: bool = True) -> ColourModel:
    """Colours of the sure inside and outside of a mask; near background counts double."""
    kernel = np.ones((3, 3), np.uint8)
    mask = inside.astype(np.uint8)
    sure = cv2.erode(mask, kernel, borderValue=1) > 0
    if sure.sum() < 0.3 * inside.sum():
        sure = inside
    outside = cv2.dilate(mask, kernel) == 0
    close = cv2.dilate(mask, np.ones((31, 31), np.uint8)) > 0
    weight = np.where(close, 2.0, 1.0).astype(np.float32)
    return ColourModel.from_samples(
        small[sure], small[outside], background_weight=weight[outside], shadows=shadows
    )
