"""The settings of the hand-over method.

>>> Handover().regression.power, Handover().taps
(1.0, 17)
"""

from dataclasses import dataclass, field

from handtrack.errors import InputError
from handtrack.mocap.regression import Regression
from handtrack.mocap.smoothing import TAPS


@dataclass(frozen=True)
class Handover:
    """Settings of a reconstruction; the defaults are the paper's."""

    regression: Regression = field(default_factory=Regression)
    components: int = 0
    """Principal components of the angles to reconstruct; 0 is all of them."""
    taps: int = TAPS
    """Taps of the cone filter at 120 Hz; 1 does not filter."""
    window: int = 0
    """Frames before and after that are regressed on too."""
    window_step_s: float = 0.05
    """Time between the frames of the window."""
    close_mm: float = 0.0
    """How near the hand is brought to its markers after the regression; 0 leaves it alone."""
    borrow: int = 0
    """Poses of other hands that join the data base (:mod:`handtrack.mocap.borrowed`)."""

    rounds: int = 1
    """Regressions: on the markers, then on the angles of the hand that was closed on them."""

    def __post_init__(self) -> None:
        if self.components < 0 or self.taps < 0 or self.window < 0 or self.window_step_s <= 0:
            raise InputError("components, taps and window must not be negative")
        if self.borrow < 0:
            raise InputError(f"{self.borrow} poses cannot be borrowed: give 0 or more")
        if self.close_mm < 0:
            raise InputError(f"markers cannot be met to {self.close_mm:.4g} mm: give 0 or more")
        if self.rounds < 1 or (self.rounds > 1 and self.close_mm == 0):
            raise InputError(
                f"{self.rounds} rounds: one or more; the second regresses on the closed hand, so "
                "say how near it is to be closed on its markers (--close-mm)"
            )
