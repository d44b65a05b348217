"""Two kinematics that share only the convention must agree; quaternions keep their axioms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.hand.kinematics import keypoints_mm as tracked_keypoints_mm
from handtrack.hand.skeleton import LIMITS
from synth import quaternion as quat
from synth.export import as_hand_shape
from synth.handspec import HAND_NAMES, HandSpec
from synth.kinematics import bone_frames, keypoints_mm


@pytest.mark.parametrize("name", HAND_NAMES)
def test_the_two_forward_kinematics_agree(name: str) -> None:
    hand = HandSpec.named(name)
    theta = np.random.default_rng(0).uniform(*LIMITS.T, (200, 20))
    shape = as_hand_shape(hand, "cardboard")
    assert np.abs(keypoints_mm(theta, hand) - tracked_keypoints_mm(theta, shape)).max() < 1e-6


def test_the_comparison_can_fail() -> None:
    hand = HandSpec.named("average")
    theta = np.full((1, 20), 0.3)
    shape = as_hand_shape(hand, "cardboard")
    other = theta.copy()
    other[0, 7] += 1e-6
    assert np.abs(keypoints_mm(other, hand) - tracked_keypoints_mm(theta, shape)).max() > 1e-6


def test_a_saved_shape_agrees_too(tmp_path) -> None:
    hand = HandSpec.named("slender")
    as_hand_shape(hand, "cardboard").save(tmp_path / "hand.toml")
    read = type(as_hand_shape(hand, "cardboard")).load(tmp_path / "hand.toml")
    theta = np.random.default_rng(1).uniform(*LIMITS.T, (20, 20))
    assert np.abs(keypoints_mm(theta, hand) - tracked_keypoints_mm(theta, read)).max() < 1e-3


def test_bones_have_their_lengths() -> None:
    hand = HandSpec.named("broad")
    _, start, end = bone_frames(np.random.default_rng(2).normal(size=(10, 20)), hand)
    lengths = np.linalg.norm(end - start, axis=-1)
    assert lengths == pytest.approx(np.tile(hand.length_mm.ravel(), (10, 1)))


@pytest.mark.parametrize("size", [1e-7, 1.0, np.pi - 1e-7])
def test_quaternions_against_scipy(size: float) -> None:
    for k, axis in enumerate("xyz"):
        q = quat.turn(axis, size)
        want = Rotation.from_rotvec(size * np.eye(3)[k]).as_matrix()
        assert quat.matrix(q) == pytest.approx(want, abs=1e-12)
        assert quat.multiply(q, quat.conjugate(q)) == pytest.approx([1, 0, 0, 0], abs=1e-12)


def test_dual_quaternions_move_rigidly() -> None:
    rng = np.random.default_rng(3)
    q = rng.normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    t, points = rng.normal(0, 100, (2, 50, 3))
    moved = quat.apply_dual(3.0 * quat.dual(q, t), points)  # of any norm
    assert moved == pytest.approx(quat.rotate(q, points) + t)


def test_there_are_many_hands_and_no_unknown_one() -> None:
    assert len(HAND_NAMES) >= 5
    with pytest.raises(Exception, match="no hand named 'x'"):
        HandSpec.named("x")
