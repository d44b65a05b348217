"""Whole-hand proposals along the weak direction: the palm pitches, the fingers make up for it.

A palm that pitches about its knuckles by ``a`` while every finger extends by ``a`` at its MCP
leaves the fingers where they are. What changes is the palm's foreshortening, ``cos`` of a small
angle, so a silhouette hardly tells such hands from one another, and refinement creeps along the
valley or sticks in it. A proposal jumps; priors and evidence then choose.
"""

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.hand.shape import HandShape
from handtrack.records import Pose

Array = NDArray[np.float64]
#: MCP flexion of the four fingers among the 20 angles.
MCP_FLEXION = [4, 8, 12, 16]


def pitched(pose: Pose, theta: Array, shape: HandShape, angle: float) -> tuple[Pose, Array]:
    """The hand whose palm has turned by ``angle`` about its x axis through the knuckles.

    The fingers' directions in space, angles ``(20,)``, stay as they are.
    """
    knuckles = shape.base_mm[1:].mean(axis=0)
    R = pose.R @ rotation.about_x(angle)
    fingers = np.array(theta, float)
    fingers[MCP_FLEXION] -= angle
    return Pose(R, pose @ knuckles - R @ knuckles), fingers
