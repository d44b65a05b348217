"""The fingers' sides in the palm's frame: the samples of the likelihood that are seen."""

import numpy as np
import pytest

from handtrack.fingers.sides import visible_sides
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default as default_space
from handtrack.hand.surface import Cardboard, project
from handtrack.records import Pose

K = np.array([400.0, 400.0, 119.5, 119.5])
POSE = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 75.0, 420.0]))
SURFACE = Cardboard(HandShape.default())


@pytest.mark.parametrize("state", [0, 9, 17])
def test_they_are_samples_of_the_patches(state: int) -> None:
    theta = default_space().basis_theta[state]
    points, normals, tangents = visible_sides(SURFACE, theta, POSE, K)
    patches = SURFACE.patches(theta[None], POSE, K)
    apart = np.linalg.norm(project(POSE @ points, K)[:, None] - patches.sample[0], axis=-1)
    # perspective puts the middle of a side's image beside the image of its middle
    assert apart.min(axis=1).max() < 0.5
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0)


def test_normals_point_out_of_the_finger() -> None:
    points, normals, _ = visible_sides(SURFACE, np.zeros(20), POSE, K)
    joints = SURFACE.sides_mm(np.zeros((1, 20)))[0].mean(axis=2)  # (5, 4, 3)
    u = np.linspace(0, 1, 60)[:, None]
    axes = (joints[:, :-1, None] * (1 - u) + joints[:, 1:, None] * u).reshape(-1, 3)
    inside, outside = (
        np.linalg.norm((points + step * normals)[:, None] - axes, axis=-1).min(axis=1)
        for step in (-3.0, 0.0)
    )
    assert (inside < outside).all()


def test_a_finger_before_another_hides_it() -> None:
    open_hand, fist = np.zeros(20), np.zeros(20)
    fist[[4, 6, 7, 8, 10, 11, 12, 14, 15, 16, 18, 19]] = 1.4
    assert len(visible_sides(SURFACE, fist, POSE, K)[0]) < len(
        visible_sides(SURFACE, open_hand, POSE, K)[0]
    )
    roots = visible_sides(SURFACE, open_hand, POSE, K, bones=1)[0]
    assert 0 < len(roots) <= 5 * 8
