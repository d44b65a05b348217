"""When a hand in track is doubted, and what a look with no idea of the pose may change.

Silhouettes can agree for a wrong hand, and a wrong hand that is followed stays wrong: so it is
looked for anew now and then, and often while the fit is poor or the energy is well above what it
was of late. A look in vain puts off the next, unless the energy has risen since. What is found must
beat what was followed, the more so the farther the palm has to jump, and meet as much of the
outline; its fingers are tried on the palm that was followed too. The other side of the hand must do
so by more, and in two looks running, or three for the side that is rarely shown: no hand turns over
from one frame to the next. A hand found by a search, perhaps while it is half in the picture, or
whose fit was shaken, is young for a second: it is looked for anew from where it was trusted last,
and faces the usual way if that fits about as well. Where the side is a guess, a back that fits
better than the palm says that it is the other hand.

At every look, and wherever a lost hand is found again, the shape cue is asked whether it sees a
hand there at all: a face behind it has its colours, and stays where the hand has left.
"""

from dataclasses import dataclass

import numpy as np

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import see_candidate
from handtrack.evidence.orientation import Image
from handtrack.evidence.silhouette import Segmenter, seen_by_shape
from handtrack.in_track import Track
from handtrack.judge import JudgeSettings, drawn, outline_seen, overlap, share_seen
from handtrack.proposals import hypotheses_of
from handtrack.refine.view import View
from handtrack.seeds import facing_of, find_hand

#: A lost hand is looked for in one frame of so many.
RECOVER_EVERY = 3


def is_due(
    track: Track, estimate: Estimate, agreement: float, judge: JudgeSettings, facing: str
) -> bool:
    """Whether to look anew in this frame; ``facing`` is the side that is usually shown."""
    poor = agreement < judge.doubted_overlap or track.votes or track.side_looks
    strains = track.strains(estimate, judge.strained)
    turned = facing_of(track.estimate) != facing
    track.doubts += 1
    every = judge.turned_every if turned else judge.check_every
    if strains and estimate.energy > judge.worse * track.excused:
        track.in_vain = 0  # it has become worse since
    if strains or track.young:  # a look in vain says that the next need not come so soon
        soon = judge.doubt_every if strains else judge.young_every
        every = min(every, soon * 2**track.in_vain)
    else:
        track.in_vain = 0  # the next doubt is a new one
    if poor:
        every = judge.doubt_every
    if track.doubts < every:
        return False
    track.doubts = 0
    return True


@dataclass(frozen=True)
class Question:
    """What a look asks: which side of the hand is taken for granted, and what the other costs."""

    failed: bool  # what is followed fits badly, or is not trusted yet
    usual: str
    cost: float
    guessed: bool  # the side of the body is a guess

    @classmethod
    def of(
        cls, track: Track, estimate: Estimate, agreement: float, judge: JudgeSettings, facing: str
    ) -> "Question":
        """The question for a track; ``facing`` is the side that is usually shown.

        A hand that is well in track faces as it did, else as hands usually do. Where the side is
        a guess neither is the likelier: the palm of one hand is the back of the other.
        """
        failed = agreement < judge.tracked_overlap or track.young > 0 or track.voted_lost
        usual = facing if failed else facing_of(estimate)
        away = usual == facing  # turning would show the side that is rarely shown
        cost = judge.turning_cost if away else judge.returning_cost
        cost = judge.facing_cost if failed else cost
        guessed = track.side_looks > 0
        return cls(failed, usual, 0.0 if guessed else cost, guessed)


def look_again(
    view: View,
    track: Track,
    estimate: Estimate,
    agreement: float,
    judge: JudgeSettings,
    facing: str,
    rng: np.random.Generator,
) -> tuple[Estimate, float]:
    """The estimate and its overlap, or those of a hand that explains the frame better."""
    question = Question.of(track, estimate, agreement, judge, facing)
    track.side_looks -= question.guessed
    hypotheses = hypotheses_of(view, track.searcher, track.anchor)
    found = find_hand(
        view, track.searcher, ("palm", "back"), rng,
        known=track.anchor, usual=question.usual, facing_cost=question.cost, hypotheses=hypotheses,
    )  # fmt: skip
    if found is None:
        return estimate, agreement
    turns_over = facing_of(found[0]) != facing_of(estimate)
    if not turns_over:
        found = _with_the_palm_held(view, track, estimate, found, judge, rng)
    if not _convinces(view, track, (estimate, agreement), found, question, judge):
        track.votes, track.voted_lost = 0, False
        track.in_vain += 1
        track.excused = estimate.energy
        return estimate, agreement
    to_usual = facing_of(found[0]) == facing
    needed = 1 if track.young and to_usual else judge.votes_to_turn + (not to_usual)
    if turns_over and track.votes + 1 < needed:
        track.votes += 1
        track.voted_lost = question.failed  # the next look asks the same question
        track.doubts = judge.doubt_every - judge.vote_every
        return estimate, agreement
    track.is_other_hand = question.guessed and turns_over
    track.fresh, track.votes, track.voted_lost, track.in_vain = True, 0, False, 0
    track.method.restart(found[0])
    return found


def _jump(before: Estimate, after: Estimate, judge: JudgeSettings) -> float:
    """What it costs that the palm is elsewhere than it was."""
    turn_deg = float(np.degrees(rotation.angle_between(before.pose.R, after.pose.R)))
    return judge.jump_cost * min(turn_deg / judge.jump_deg, 1.0)


def _with_the_palm_held(
    view: View,
    track: Track,
    estimate: Estimate,
    found: tuple[Estimate, float],
    judge: JudgeSettings,
    rng: np.random.Generator,
) -> tuple[Estimate, float]:
    """What was found, or its fingers on the palm that was followed where that does as well."""
    held = track.searcher.with_fingers(view, estimate, found[0].theta, rng)
    if track.searcher.energy(view, held) > found[0].energy + _jump(held, found[0], judge):
        return found
    return held, overlap(track.searcher.hand, held, view, judge.wrist_line_mm)


def _convinces(
    view: View,
    track: Track,
    followed: tuple[Estimate, float],
    found: tuple[Estimate, float],
    question: Question,
    judge: JudgeSettings,
) -> bool:
    """Whether what was found explains the frame well enough to go on from it."""
    turns = not question.failed and facing_of(found[0]) != question.usual
    saved = track.searcher.energy(view, followed[0]) - found[0].energy
    margin = judge.cheaper_by + question.cost * turns
    margin += 0.0 if question.failed else _jump(followed[0], found[0], judge)
    if question.failed and facing_of(found[0]) == question.usual != facing_of(followed[0]):
        margin -= question.cost
    better = not turns and found[1] > followed[1] + judge.better_by
    better &= question.failed or saved > 0
    cheaper = found[1] > followed[1] - judge.better_by and saved > margin
    line_mm = judge.wrist_line_mm
    before = max(outline_seen(followed[0], view, line_mm), 0.01)
    more = outline_seen(found[0], view, line_mm) / before
    fuller = more > judge.more_seen and found[1] > judge.tracked_overlap
    return more >= judge.less_seen and (better or fuller or cheaper)


def recover(
    image: Image,
    camera: Camera,
    track: Track,
    judge: JudgeSettings,
    facing: str,
    rng: np.random.Generator,
) -> None:
    """Look in the whole frame, now and then, for a hand that is lost or astray; then track it.

    Of several things that a hand fits, the other hand among them, it is the one that costs least.
    """
    track.frames_astray += 1
    if track.frames_astray % RECOVER_EVERY != 1:
        return
    segmenter, shape = track.segmenter, None
    fits: list[tuple[float, Estimate]] = []
    anything = segmenter.find(image) or Segmenter.bootstrap(image, segmenter.background)
    for candidate in anything[:2]:
        *_, evidence = see_candidate(image, candidate.mask, camera, segmenter)
        view = View.of(evidence)
        found = find_hand(
            view, track.searcher, ("palm", "back"), rng,
            known=track.anchor, usual=facing, facing_cost=judge.facing_cost,
            hypotheses=hypotheses_of(view, track.searcher, track.anchor),
        )  # fmt: skip
        if found is None or found[1] <= judge.tracked_overlap:
            continue
        cost = found[0].energy + judge.facing_cost * (facing_of(found[0]) != facing)
        shape = seen_by_shape(image) if shape is None else shape
        seen = share_seen(shape, drawn(track.searcher.hand, found[0], camera))
        if seen >= judge.min_seen:
            fits.append((cost, found[0]))
    if fits:
        track.found_again(min(fits, key=lambda fit: fit[0])[1])
