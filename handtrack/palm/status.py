"""How a palm solver ended: members of one enum, each with a sentence for people.

A palm that cannot be solved for is a status, never an exception and never a silent NaN.

>>> PalmStatus.COLLINEAR.usable, PalmStatus.COLLINEAR.sentence
(False, 'the points lie on a line (or the plane is seen edge-on), so the pose is not determined')
"""

from enum import Enum


class PalmStatus(Enum):
    """The end of a solver; ``usable`` says whether its poses mean anything."""

    CONVERGED = "converged"
    ROUND_LIMIT = "round limit"
    TOO_FEW_POINTS = "too few points"
    TOO_FEW_FRAMES = "too few frames"
    COLLINEAR = "collinear"
    NOT_TURNED = "not turned"
    TWO_PLANES = "two planes"
    NOT_A_PLANE = "not a plane"
    BAD_START = "bad start"
    BEHIND_CAMERA = "behind camera"

    @property
    def sentence(self) -> str:
        """The status as a sentence."""
        return _SENTENCES[self]

    @property
    def usable(self) -> bool:
        """Whether the poses may be used."""
        return self in (PalmStatus.CONVERGED, PalmStatus.ROUND_LIMIT, PalmStatus.TWO_PLANES)


_SENTENCES = {
    PalmStatus.CONVERGED: "the palm's pose was found",
    PalmStatus.ROUND_LIMIT: "the palm's pose still moved when the rounds were used up",
    PalmStatus.TOO_FEW_POINTS: "too few points were matched to determine the palm's pose",
    PalmStatus.TOO_FEW_FRAMES: "too few frames: an unknown plane needs three of known scale",
    PalmStatus.COLLINEAR: (
        "the points lie on a line (or the plane is seen edge-on), so the pose is not determined"
    ),
    PalmStatus.NOT_TURNED: (
        "the plane did not turn out of itself between the frames, so its shape is not determined"
    ),
    PalmStatus.TWO_PLANES: "two different planes explain the frames; the first is one of them",
    PalmStatus.NOT_A_PLANE: "no plane under scaled orthography explains the frames",
    PalmStatus.BAD_START: "the pose to start from is not finite or not a rotation",
    PalmStatus.BEHIND_CAMERA: "a point of the palm came to lie behind the camera",
}
