"""The two surfaces behind one interface."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.hand.shape import HandShape
from handtrack.hand.surface import Capsules, Cardboard, Surface
from handtrack.records import Pose

K = np.array([400.0, 400.0, 119.5, 119.5])
FRONTAL = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 75.0, 420.0]))


@pytest.mark.parametrize("surface", [Cardboard(HandShape.default()), Capsules(HandShape.default())])
def test_shapes_and_unit_normals(surface: Surface) -> None:
    theta = np.random.default_rng(0).uniform(-0.1, 1.0, (7, 20))
    seen = surface.patches(theta, FRONTAL, K)
    n_patches = len(seen.digit)
    assert seen.corners.shape[:2] == (7, n_patches)
    assert seen.depth_mm.shape == (7, n_patches)
    assert seen.sample.shape == seen.normal.shape == (7, len(seen.sample_patch), 2)
    np.testing.assert_allclose(np.linalg.norm(seen.normal, axis=-1), 1.0, atol=1e-9)
    assert set(seen.digit) == {-1, 0, 1, 2, 3, 4}


def test_cardboard_vanishes_edge_on_and_capsules_do_not() -> None:
    edge_on = Pose(FRONTAL.R @ rotation.exp([0.0, np.pi / 2, 0.0]), FRONTAL.t_mm)
    widths = []
    for surface in (Cardboard(HandShape.default()), Capsules(HandShape.default())):
        corners = surface.patches(np.zeros((1, 20)), edge_on, K).corners[0]
        widths.append(
            np.ptp(corners[surface.patches(np.zeros((1, 20)), edge_on, K).digit == 2][..., 0])
        )
    assert widths[0] < 3.0 < 10.0 < widths[1]


def test_lateral_samples_lie_on_their_patch_and_look_out_of_it() -> None:
    for surface in (Cardboard(HandShape.default()), Capsules(HandShape.default())):
        seen = surface.patches(np.zeros((1, 20)), FRONTAL, K)
        middle = seen.corners[0].mean(axis=1)[seen.sample_patch]
        outwards = np.sum((seen.sample[0] - middle) * seen.normal[0], axis=1)
        assert (outwards > 0).mean() > 0.97
