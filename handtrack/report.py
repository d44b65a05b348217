"""From the tracked model (always a right hand, perhaps in a mirrored image) to the hand as filmed.

A left hand is the mirror image of the model. With ``S = diag(-1, 1, 1)`` a model point
``X = R p + t`` is filmed at ``S X``; in the left hand's own palm frame the point is ``S p``, so the
pose reported is ``S R S``, ``S t``. The 20 angles stay the same.
"""

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Frame, FrameResult, Pose, Status

Array = NDArray[np.float64]
MIRROR = np.diag([-1.0, 1.0, 1.0])


def unmirrored(pose: Pose) -> Pose:
    """The pose of the filmed left hand that is tracked as a right hand in the mirror."""
    return Pose(MIRROR @ pose.R @ MIRROR, MIRROR @ pose.t_mm)


def result_of(
    frame: Frame,
    estimate: Estimate,
    status: Status,
    confidence: float,
    side: str,
    shape: HandShape,
    camera: Camera,
) -> FrameResult:
    """The record of one frame; ``camera`` is that of the clip as filmed."""
    pose = unmirrored(estimate.pose) if side == "left" else estimate.pose
    points_mm = in_camera(estimate.theta, pose.R, pose.t_mm, side, shape)
    return FrameResult(
        index=frame.index,
        time_s=frame.time_s,
        status=status,
        side=side,
        confidence=confidence,
        ess=estimate.ess,
        R=pose.R,
        t_mm=pose.t_mm,
        theta=estimate.theta,
        theta_std=estimate.theta_std,
        keypoints_px=camera.project(points_mm),
        keypoints_mm=points_mm,
    )


def in_camera(theta: Array, R: Array, t_mm: Array, side: str, shape: HandShape) -> Array:
    """The 21 keypoints ``(21, 3)`` in the camera frame, of a hand as filmed (mm)."""
    keypoints = keypoints_mm(theta, shape)
    return Pose(R, t_mm) @ (keypoints @ MIRROR if side == "left" else keypoints)
