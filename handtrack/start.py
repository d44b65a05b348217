"""How tracking starts: candidate silhouettes, a hand among them, its side and its shape.

An open palm that faces the camera is best: its silhouette gives the shape (bone lengths, thumb,
axes), the pose and the side at once. Where no frame shows one, any silhouette into which the hand
(given, or the default adult) can be fitted well starts tracking too (:mod:`handtrack.searched`),
and the shape is calibrated when an open palm comes by.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.candidates import Candidate
from handtrack.evidence.evidence import Evidence, see_candidate
from handtrack.evidence.silhouette import Segmenter, seen_by_shape
from handtrack.hand.shape import HandShape
from handtrack.parallel import each
from handtrack.records import Pose

#: Standard deviation of an angle just after the start.
START_STD = np.radians(8.0)


class Calibration(Protocol):
    """What a calibrator says of a silhouette (``calib.hand.CalibrationResult``)."""

    shape: HandShape
    pose: Pose
    theta: NDArray[np.float64]
    side: str
    residual_px: float
    quality: float

    @property
    def ok(self) -> bool:
        """Whether a hand was found and fitted."""
        ...


#: ``calibrate(mask, camera, default, side, facing, visible, fit_shape, min_quality)``, which gives
#: a :class:`Calibration`; or None.
Calibrate = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class Start:
    """A hand found with no idea where it was; of a left hand everything is mirrored."""

    shape: HandShape
    estimate: Estimate
    side: str
    segmenter: Segmenter
    overlap: float
    quality: float  # of the open hand that its shape was calibrated from; 0 for none
    seen: float = 1.0  # mean probability inside it by the shape cue, if that was asked


@dataclass(frozen=True)
class StartSettings:
    """What is believed at the start."""

    candidates: int = 4
    """Silhouettes that are looked at in a frame."""
    min_quality: float = 0.35
    """Quality of an open hand from which its shape is calibrated."""
    clear: float = 0.7
    """Worth of an open hand from which no other silhouettes are looked at: its quality, less where
    the colours are doubtful or the outline is not met."""
    good_quality: float = 0.9
    """Quality from which no better one is waited for."""
    better_quality: float = 0.2
    """And by how much a later one must be better to take its place."""
    min_overlap: float = 0.88
    """Overlap from which a hand that is not open is believed,"""
    min_overlap_seen: float = 0.84
    """and from which it is where the shape cue sees it:"""
    seen: float = 0.7
    """mean probability of hand, by that cue, inside the hand as fitted; where the outline is the
    cue's own, nothing is believed without it."""
    min_seen: float = 0.5
    """Without so much of it nothing is believed."""
    max_solidity: float = 0.9
    """Share of its convex hull that a silhouette may fill to be believed, if it is not open."""
    closer: float = 0.015
    """Overlap by which a hand must be the better as one side to be a unit in the lead, where the
    side is not told."""
    cheaper: float = 8.0
    """Energy by which it must be."""
    min_in_frame: float = 0.7
    """Share of a hand's joints and tips that lie in the frame."""
    min_lead: float = 4.0
    """Units by which one side must lead in the first look; later ones want less."""
    patience: int = 20
    """Frames after the first that a hand fits, from which on whichever side leads will do."""
    look_every: int = 5
    """Frames between two looks for a hand that is not open."""


def calibrated_start(
    image: NDArray[np.uint8],
    candidates: Sequence[Candidate],
    camera: Camera,
    calibrate: Calibrate,
    default: HandShape,
    side: str,
    facing: str,
    settings: StartSettings,
    fit_shape: bool = True,
) -> Start | None:
    """A start from an open palm in one of the frame's candidate silhouettes.

    Without ``fit_shape`` the hand is ``default`` and only its pose is found.
    """

    def start_on(candidate: Candidate) -> Start | None:
        segmenter = Segmenter.from_mask(image, candidate.mask, shape=shape)
        for evidence in see_candidate(image, candidate.mask, camera, segmenter):
            found = calibrate(
                evidence.mask,
                evidence.camera,
                default=default,
                side=None if side == "auto" else side,
                facing=facing,
                visible=evidence.visible,
                fit_shape=fit_shape,
                min_quality=settings.min_quality,
            )
            if found.ok:
                break
        if not found.ok:
            return None
        return Start(
            shape=found.shape,
            estimate=Estimate(found.pose, found.theta, np.full(20, START_STD)),
            side=found.side,
            segmenter=segmenter.mirrored() if found.side == "left" else segmenter,
            # of silhouettes alike, the one that is a hand and nothing else
            overlap=found.quality * evidence.confidence / (1 + found.residual_px),
            quality=found.quality,
        )

    starts: list[Start] = []
    likely = candidates[: settings.candidates]
    shape = seen_by_shape(image) if likely else None
    for k in range(0, len(likely), 2):
        starts += [start for start in each(start_on, likely[k : k + 2]) if start is not None]
        if any(start.overlap >= settings.clear for start in starts):
            break
    return max(starts, key=lambda start: start.overlap, default=None)


def recalibrated(
    evidence: Evidence,
    calibrate: Calibrate,
    default: HandShape,
    facing: str,
    settings: StartSettings,
    side: str | None = "right",
    quality: float = 0.0,
) -> Calibration | None:
    """The shape from a tracked frame, if it shows an open palm; mirrored as the tracker is.

    ``quality`` is that of the palm which the shape is from so far, 0 for none. With ``side`` None
    the palm says which side it is: "left" if the wrong side is tracked.
    """
    found: Calibration = calibrate(
        evidence.mask,
        evidence.camera,
        default=default,
        side=side,
        facing=facing,
        visible=evidence.visible,
        min_quality=max(settings.min_quality, quality + settings.better_quality),
    )
    return found if found.ok else None
