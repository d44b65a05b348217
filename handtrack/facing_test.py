"""Whether a hand shows the side that it was taken to show, told by and by.

Where neither side nor facing is told, a hand is taken to show its palm: the back of a left hand is
then followed as the palm of a right one, and its silhouette agrees. And a little finger, or what is
behind the hand, may be taken for the thumb. What the :mod:`~handtrack.proposer.facing_cue` says of
frame after frame is added up, as in a sequential test (Wald 1945), until it speaks clearly for or
against what is followed; palm and thumb have a test each. Neighbouring frames look alike, so each
counts for a part of what it says, and what says little does not count at all.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class FacingSettings:
    """What is believed."""

    right: float = 0.5
    """A frame's log odds below which it says nothing for what is followed,"""
    wrong: float = 1.5
    """and nothing against it: an open hand shows little of its side, for frames on end."""
    most: float = 3.0
    """What is above that is clipped here,"""
    share: float = 0.2
    """and so much of it counts: frames of a clip resemble each other."""
    sure: float = 3.0
    """What settles it."""


class FacingTest:
    """Adds up what speaks for what is followed."""

    def __init__(self, settings: FacingSettings | None = None) -> None:
        self.settings = settings or FacingSettings()
        self.lead = 0.0

    def watch(self, told: float) -> None:
        """Take in a frame: log odds of what is followed."""
        s = self.settings
        clear = max(told - s.right, 0.0) - max(-told - s.wrong, 0.0)
        self.lead += s.share * float(np.clip(clear, -s.most, s.most))

    @property
    def is_wrong(self) -> bool:
        """Whether it is otherwise."""
        return self.lead <= -self.settings.sure

    @property
    def is_over(self) -> bool:
        """Whether nothing more is asked."""
        return abs(self.lead) >= self.settings.sure
