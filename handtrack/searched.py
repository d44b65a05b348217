"""A start from any pose: the hand is sought in a frame's silhouettes, as either side.

A silhouette says little of the side: the palm of one hand looks like the back of the other, and a
fist much like its mirror image. So both are sought, and what speaks for one of them, in overlap and
in energy, is added up from look to look, as in a sequential test (Wald 1945). The longer it takes,
the less is wanted: an unsure answer is better than none.

Where the side is told and there are silhouettes in several places, the same test tells which of
them is the other hand: it is left alone, as long as there is patience.

Nor does a silhouette say much of what it is of: a hand fits into the outline of many a face. So the
:mod:`~handtrack.evidence.shape_cue` must see a hand where it was found, and where it sees one
clearly a rough silhouette will do.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import islice

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.candidates import Candidate
from handtrack.evidence.evidence import see_candidate
from handtrack.evidence.orientation import Image
from handtrack.evidence.silhouette import Segmenter, seen_by_shape
from handtrack.hand.shape import HandShape
from handtrack.judge import drawn, share_seen
from handtrack.proposals import hypotheses_of
from handtrack.records import OTHER_SIDE
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod
from handtrack.seeds import find_hand
from handtrack.start import Start, StartSettings

#: Silhouettes of a frame in which the hand is sought.
SILHOUETTES = 2
#: Less plausible ones than this share of the best are none.
AS_LIKELY = 0.6
#: Where the side is told, one more joins them that lies elsewhere: it shares no more of its area
#: with them than this, and may be so much less plausible, since small hands are.
SHARED, AS_LIKELY_ELSEWHERE = 0.1, 0.3

#: Looks at candidates for a hand of one side; the starts have the candidates' numbers.
Look = Callable[[Sequence[Candidate], str], dict[int, Start]]


class SearchedStart:
    """Looks for a hand of one shape in frame after frame until its side is told.

    Parameters
    ----------
    make_method : callable
        The method for a shape.
    shape : HandShape
    side : "right", "left" or "auto"
        Which hand it is; auto: whichever explains the pictures better.
    facing : "palm" or "back"
        The side of the hand that is shown.
    settings : StartSettings
    """

    def __init__(
        self,
        make_method: Callable[[HandShape], RefinedMethod],
        shape: HandShape,
        side: str,
        facing: str,
        settings: StartSettings,
    ) -> None:
        self.method, self.shape = make_method(shape), shape
        self.sides = ("right", "left") if side == "auto" else (side,)
        self.facing, self.settings = facing, settings
        self.frame = 0
        self.first: int | None = None  # frame in which something fitted first
        self.lead = 0.0  # what has spoken for the right hand so far

    def __call__(
        self,
        image: Image,
        silhouettes: Callable[[], Sequence[Candidate]],
        camera: Camera,
        rng: np.random.Generator,
    ) -> Start | None:
        """A start on one of the frame's silhouettes, or None while none is good or no side told.

        ``silhouettes`` gives them, the likeliest first; not every frame asks for them.
        """
        frame, self.frame = self.frame, self.frame + 1
        if frame % self.settings.look_every:
            return None
        likely = self._sought(silhouettes())
        look = partial(self._found, image, camera, rng)
        if len(self.sides) == 1:
            return self._of_told_side(self.sides[0], likely, look, frame)
        return self._of_either_side(likely, look, frame)

    def _of_either_side(
        self, candidates: Sequence[Candidate], look: Look, frame: int
    ) -> Start | None:
        """The hand as the side that leads, if it leads by enough for the time it has taken."""
        found = {side: look(candidates, side).values() for side in self.sides}
        starts = {side: _fittest(those) for side, those in found.items() if those}
        good = {side for side, start in starts.items() if self._is_good(start)}
        if not good:
            return None
        wanted = self.settings.min_lead * self._patience(frame)
        self.lead += self._lead(starts)
        ahead = "right" if self.lead > 0 else "left"
        return starts[ahead] if ahead in good and abs(self.lead) >= wanted else None

    def _of_told_side(
        self, side: str, candidates: Sequence[Candidate], look: Look, frame: int
    ) -> Start | None:
        """The hand that fits; of several, the one least like the other hand, if it is not that."""
        good = {k: s for k, s in look(candidates, side).items() if self._is_good(s)}
        if not good:
            return None
        if not self._patience(frame) or not in_several_places(candidates):
            return _fittest(good.values())
        other = OTHER_SIDE[side]
        mirrored = look([candidates[k] for k in good], other)
        leads: dict[int, float] = {}
        for at, (k, start) in enumerate(good.items()):
            lead = self._lead({side: start} | ({other: mirrored[at]} if at in mirrored else {}))
            leads[k] = lead if side == "right" else -lead
        most = max(leads, key=lambda k: leads[k])
        return good[most] if leads[most] > -self.settings.min_lead else None

    def _patience(self, frame: int) -> float:
        """What is left of it, 1 to 0, since something fitted first."""
        self.first = frame if self.first is None else self.first
        return max(1 - (frame - self.first) / self.settings.patience, 0.0)

    def _sought(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Those of a frame's candidates, the likeliest first, in which the hand is sought."""
        best = [c for c in candidates[:SILHOUETTES] if c.score >= AS_LIKELY * candidates[0].score]
        if len(self.sides) == 2:
            return best
        elsewhere = (
            c
            for c in candidates[SILHOUETTES:]
            if c.score >= AS_LIKELY_ELSEWHERE * best[0].score and all(_apart(c, b) for b in best)
        )
        return best + list(islice(elsewhere, 1))

    def _found(
        self,
        image: Image,
        camera: Camera,
        rng: np.random.Generator,
        candidates: Sequence[Candidate],
        side: str,
    ) -> dict[int, Start]:
        """The hand, as one side, in those of the candidates that may be one, by their number."""
        flip = side == "left"
        picture = np.ascontiguousarray(image[:, ::-1]) if flip else image
        seen_by = camera.mirrored() if flip else camera
        starts: dict[int, Start] = {}
        if not candidates:
            return starts
        shape = seen_by_shape(picture)
        for k, candidate in enumerate(candidates):
            mask = candidate.mask[:, ::-1] if flip else candidate.mask
            segmenter = Segmenter.from_mask(picture, mask, shape=shape)
            *_, evidence = see_candidate(picture, mask, seen_by, segmenter)
            if solidity(evidence.mask) > self.settings.max_solidity:
                continue  # a fist fits any round thing: wait for a finger
            view = View.of(evidence)
            told = hypotheses_of(view, self.method)
            found = find_hand(view, self.method, (self.facing,), rng, hypotheses=told)
            if found is None:
                continue
            if share_in_frame(self.method, found[0], view) < self.settings.min_in_frame:
                continue
            seen = share_seen(shape, drawn(self.method.hand, found[0], seen_by))
            if seen >= self.settings.min_seen:
                starts[k] = Start(self.shape, found[0], side, segmenter, found[1], 0.0, seen)
        return starts

    def _is_good(self, start: Start) -> bool:
        s = self.settings
        if start.seen >= s.seen:
            return start.overlap >= s.min_overlap_seen
        # an outline by the shape cue, which is not sure of the hand inside it, says nothing
        return start.overlap >= s.min_overlap and not start.segmenter.by_shape

    def _lead(self, starts: dict[str, Start]) -> float:
        """What this frame says for the right hand, against the left."""
        s = self.settings
        if len(starts) == 1:
            return s.min_lead if "right" in starts else -s.min_lead
        right, left = starts["right"], starts["left"]
        closer = (right.overlap - left.overlap) / s.closer
        cheaper = (left.estimate.energy - right.estimate.energy) / s.cheaper
        return float(np.clip(closer + cheaper, -2 * s.min_lead, 2 * s.min_lead))


def in_several_places(candidates: Sequence[Candidate]) -> bool:
    """Whether some two of a frame's candidates lie apart."""
    return any(_apart(b, a) for k, b in enumerate(candidates) for a in candidates[:k])


def _apart(one: Candidate, other: Candidate) -> bool:
    shared = np.count_nonzero(one.mask & other.mask)
    return bool(shared <= SHARED * np.count_nonzero(one.mask))


def _fittest(starts: Iterable[Start]) -> Start:
    return max(starts, key=lambda start: start.overlap)


def share_in_frame(method: RefinedMethod, estimate: Estimate, view: View) -> float:
    """Share of a hand's joints and tips that lie inside the frame."""
    pose = estimate.pose
    circles = method.hand.circles_px(estimate.theta[None], pose.R, pose.t_mm, view.intrinsics)[0]
    x0, y0, x1, y1 = view.valid
    x, y = circles[:, 0], circles[:, 1]
    return float(np.mean((x >= x0) & (x < x1) & (y >= y0) & (y < y1)))


def solidity(mask: NDArray[np.bool_]) -> float:
    """Area of a silhouette over that of its convex hull; 1 for none.

    >>> disc = np.hypot(*np.mgrid[-20:21, -20:21]) < 18
    >>> solidity(disc) > 0.95
    True
    """
    points = np.argwhere(mask)
    if len(points) < 10:
        return 1.0
    hull = cv2.convexHull(points[:, ::-1].astype(np.int32))
    return float(len(points) / max(cv2.contourArea(hull), 1.0))
