"""A synthetic hand's measures as a `HandShape`, for the truth beside a clip."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handtrack.hand.shape import HandShape
from synth import quaternion as quat
from synth.cardboard import palm_outline as flat_outline
from synth.handspec import HandSpec
from synth.surface import rest_mesh

Array = NDArray[np.float64]


def as_hand_shape(hand: HandSpec, surface: str = "smooth") -> HandShape:
    """The same joints, axes, bones and radii; the palm's outline as the surface has it."""
    rest = Rotation.from_matrix(quat.matrix(hand.rest)).as_rotvec()
    return HandShape(
        base_mm=hand.base_mm,
        rest_rotvec=rest,
        length_mm=hand.length_mm,
        radius_mm=hand.radius_mm,
        palm_outline_mm=flat_outline(hand) if surface == "cardboard" else palm_outline(hand),
        palm_radius_mm=float(hand.palm_thickness_mm.mean()),
        wrist_radius_mm=float(hand.wrist_mm[0]),
        calibrated=True,
        source="synthetic truth",
    )


def palm_outline(hand: HandSpec) -> Array:
    """Outline ``(n, 2)`` of the smooth palm, in the order of the cardboard one."""
    mesh = rest_mesh(hand, 40.0)
    vertices = mesh.vertices
    little, index, middle = hand.base_mm[4], hand.base_mm[1], hand.base_mm[2]
    right, left = [], []
    for share in (-0.04, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 0.95):
        y = share * middle[1]
        ring = vertices[np.abs(vertices[:, 1] - y) < 1.5]
        reach = index[0] + hand.radius_mm[1, 0]
        right.append((min(ring[:, 0].max(), reach), y))
        if y < little[1] + 6:
            left.append((ring[:, 0].min(), y))
    over = 0.3 * hand.length_mm[1:, 0].mean()
    top = [(hand.base_mm[d, 0], hand.base_mm[d, 1] + over) for d in range(1, 5)]
    return np.array([*right, *top, *left[::-1]])
