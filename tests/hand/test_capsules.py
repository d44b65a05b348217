"""Capsules: the distance against brute force, nodes, and the outline of the flat palm."""

import numpy as np

from handtrack.hand.capsules import CapsuleHand, _inset, capsule_distance
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape


def test_distance_against_a_fine_search() -> None:
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 4001)
    for _ in range(300):
        a, b, p = 20 * rng.normal(size=(3, 2))
        ra, rb = rng.uniform(1, 15, 2)
        axis = a + (b - a) * t[:, None]
        expected = np.min(np.hypot(*(p - axis).T) - (ra + t * (rb - ra)))
        assert abs(capsule_distance(*p, *a, ra, *b, rb)[0] - expected) < 2e-3


def test_a_disc_that_holds_the_other_is_the_capsule() -> None:
    assert capsule_distance(0.0, 30.0, 0.0, 0.0, 20.0, 5.0, 0.0, 3.0) == (10.0, 0.0)
    assert capsule_distance(35.0, 0.0, 0.0, 0.0, 3.0, 5.0, 0.0, 20.0) == (10.0, 1.0)


def test_the_last_capsule_ends_on_the_tip() -> None:
    shape = HandShape.default()
    hand = CapsuleHand(shape)
    theta = np.random.default_rng(1).uniform(-0.2, 1.0, (4, 20))
    nodes, keypoints = hand.nodes_mm(theta), keypoints_mm(theta, shape)
    for d in range(5):
        node = hand.capsule_node[(hand.capsule_digit == d) & (hand.capsule_bone == 2)][0, 1]
        gap = np.linalg.norm(keypoints[:, 4 + 4 * d] - nodes[:, node], axis=1)
        np.testing.assert_allclose(gap, shape.radius_mm[d, 3], atol=1e-9)


def test_the_rim_of_the_palm_is_its_outline() -> None:
    outline = np.array([[-40.0, 0.0], [40.0, 0.0], [40.0, 90.0], [-40.0, 90.0]])
    for corners in (outline, outline[::-1]):
        np.testing.assert_allclose(np.abs(_inset(corners, 10.0)[:, 0]), 30.0)
        assert sorted(_inset(corners, 10.0)[:, 1].round(9)) == [10.0, 10.0, 80.0, 80.0]


def test_circles_grow_as_the_hand_comes_nearer() -> None:
    hand = CapsuleHand(HandShape.default())
    K = np.array([500.0, 500.0, 320.0, 240.0])
    near, far = (
        hand.circles_px(np.zeros((1, 20)), np.diag([1.0, -1.0, -1.0]), np.array([0, 0, z]), K)[0]
        for z in (300.0, 600.0)
    )
    flat = hand.node_digit < 0  # the palm's own, all in its plane
    ratio = near[flat, 2] / far[flat, 2]
    assert np.median(ratio) > 1.9
