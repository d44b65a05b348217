"""What a calibration made of a picture, as sentences for people.

>>> Seen.OPEN_HAND.sentence
'an open hand with five fingertips'
"""

from enum import Enum


class Seen(Enum):
    """What a silhouette shows; the value is a sentence for people."""

    OPEN_HAND = "an open hand with five fingertips"
    NOTHING = "the silhouette is empty or too small to hold a hand"
    FEW_TIPS = "fewer than five fingertips stand out: open the hand and spread the fingers"
    MANY_TIPS = "more than five tips stand out: show one hand, away from other things"
    NO_HAND = "five tips stand out, but without the proportions of a hand"
    CLIPPED = "the hand runs over the edge of the picture: show all of it"
    HALF_OPEN = "a hand was found, but not open and flat enough: spread the fingers, palm flat"
    OTHER_SIDE = "the thumb is on the other side: check the side, or which way the hand faces"
    POOR_FIT = "a hand was found but the model does not fit it: show it flat to the camera"
    NO_THUMB = "the thumb cannot be told from the little finger: spread the thumb"

    @property
    def sentence(self) -> str:
        """The value as text."""
        return str(self.value)
