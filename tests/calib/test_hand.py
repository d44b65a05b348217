"""Calibration of drawn hands against what is true of them."""

from dataclasses import replace

import numpy as np
import pytest

from calib.fit import Target, joints_mm, residuals, start_pose
from calib.hand import calibrate_hand
from calib.landmarks import find_landmarks, start_quality
from calib.parameters import N, unpack
from calib.seen import Seen
from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape

N_HANDS = 16


@pytest.fixture(scope="module")
def pairs(open_hand):
    """Drawn hands, every other one a left hand, and their calibrations."""
    result = []
    for seed in range(100, 100 + N_HANDS):
        hand = open_hand(np.random.default_rng(seed), tilt_deg=5.0)
        if seed % 2:
            result.append(
                (hand, calibrate_hand(hand.mask[:, ::-1], hand.camera.mirrored()), "left")
            )
        else:
            result.append((hand, calibrate_hand(hand.mask, hand.camera), "right"))
    return [(hand, found, side) for hand, found, side in result if found.landmarks is not None]


def test_most_hands_are_calibrated(pairs):
    assert sum(found.ok for _, found, _ in pairs) >= 0.85 * N_HANDS


def test_side(pairs):
    assert all(found.side == side for _, found, side in pairs)


def test_outline_fits(pairs):
    assert np.mean([found.residual_px for _, found, _ in pairs]) < 0.3
    assert max(found.residual_px for _, found, _ in pairs) < 1.0


def test_digits_have_their_length(pairs):
    error = np.array(
        [
            np.log(found.shape.length_mm.sum(axis=1) / hand.shape.length_mm.sum(axis=1))
            for hand, found, _ in pairs
        ]
    )
    assert np.median(np.abs(error[:, 1:])) < 0.04
    assert np.median(np.abs(error[:, 0])) < 0.05
    assert np.abs(error).max() < 0.15


def test_better_than_the_default_hand(pairs):
    """Axes and lengths move towards the truth, not away from it."""
    default = HandShape.default()

    def axis_error(shape: HandShape, truth: HandShape) -> np.ndarray:
        y = rotation.exp(shape.rest_rotvec)[:, :, 1], rotation.exp(truth.rest_rotvec)[:, :, 1]
        return np.arccos(np.clip((y[0] * y[1]).sum(axis=1), -1, 1))

    after = np.mean([axis_error(f.shape, h.shape) for h, f, _ in pairs], axis=0)
    before = np.mean([axis_error(default, h.shape) for h, f, _ in pairs], axis=0)
    assert after.mean() < before.mean() + np.radians(0.3)


def test_keypoints_land_on_the_truth(pairs):
    for hand, found, _ in pairs:
        here = hand.camera.project(found.pose @ keypoints_mm(found.theta, found.shape))
        off = np.linalg.norm(here - hand.keypoints_px, axis=1)
        assert off[4::4].max() < 3.0
        assert off.mean() < 4.0


def test_back_of_the_hand(open_hand):
    hand = open_hand(np.random.default_rng(5), tilt_deg=0.0, facing="back")
    found = calibrate_hand(hand.mask, hand.camera, facing="back")
    assert found.ok
    assert found.side == "right"
    assert rotation.angle_between(found.pose.R, hand.pose.R) < np.radians(4)


def test_scale_comes_from_the_length_of_the_hand(open_hand):
    hand = open_hand(np.random.default_rng(3), tilt_deg=0.0)
    plain = calibrate_hand(hand.mask, hand.camera)
    scaled = calibrate_hand(hand.mask, hand.camera, hand_length_mm=160.0)
    shape = scaled.shape
    assert shape.palm_length_mm + shape.length_mm[2].sum() == pytest.approx(160.0)
    a = hand.camera.project(plain.pose @ keypoints_mm(plain.theta, plain.shape))
    b = hand.camera.project(scaled.pose @ keypoints_mm(scaled.theta, shape))
    np.testing.assert_allclose(a, b, atol=1e-6)


def test_pose_alone(pairs):
    """With the true hand given, the shape stays as it is and the pose comes out better."""
    for hand, _, side in pairs:
        if side == "right":
            found = calibrate_hand(hand.mask, hand.camera, default=hand.shape, fit_shape=False)
            assert found.ok
            assert found.shape is hand.shape
            here = hand.camera.project(found.pose @ keypoints_mm(found.theta, found.shape))
            assert np.linalg.norm(here - hand.keypoints_px, axis=1).mean() < 2.0


def test_palm_keeps_its_length_and_frame(pairs):
    for _, found, _ in pairs:
        np.testing.assert_allclose(found.shape.base_mm[2], HandShape.default().base_mm[2])
        assert found.shape.calibrated


def test_a_known_side_that_is_not_shown_is_refused(open_hand):
    hand = open_hand(np.random.default_rng(3))
    assert calibrate_hand(hand.mask, hand.camera, side="left").status is Seen.OTHER_SIDE
    assert calibrate_hand(hand.mask, hand.camera, side="right").ok


def test_refusal_is_a_result():
    found = calibrate_hand(np.zeros((40, 40), bool), Camera.assumed_for(40, 40))
    assert not found.ok
    assert np.isnan(found.theta).all()
    assert found.shape.calibrated is False


@pytest.mark.parametrize(
    ("options", "text"), [({"side": "both"}, "side"), ({"facing": "up"}, "facing")]
)
def test_wrong_options_are_named(options, text):
    with pytest.raises(InputError, match=text):
        calibrate_hand(np.zeros((40, 40), bool), Camera.assumed_for(40, 40), **options)


def test_mask_and_camera_must_agree():
    with pytest.raises(InputError, match="40x30"):
        calibrate_hand(np.zeros((30, 40), bool), Camera.assumed_for(40, 40))


def test_joints_agree_with_the_kinematics():
    z = np.random.default_rng(0).normal(size=(3, N))
    hands = unpack(z, HandShape.default())
    for n in range(3):
        shape = HandShape(
            hands.base_mm[n],
            rotation.log(hands.rest[n]),
            hands.length_mm[n],
            hands.radius_mm[n],
            HandShape.default().palm_outline_mm,
            12.0,
            26.0,
        )
        expected = keypoints_mm(hands.theta[n], shape)[1:].reshape(5, 4, 3)
        np.testing.assert_allclose(joints_mm(hands)[n], expected, atol=1e-9)


def test_shares_keep_the_digit_and_prior_is_the_norm(open_hand):
    hand = open_hand(np.random.default_rng(3))
    landmarks, default = find_landmarks(hand.mask), HandShape.default()
    target = Target.of(landmarks, hand.camera, default)
    z = np.random.default_rng(1).normal(size=(1, N))
    start = start_pose(landmarks, hand.camera, default, "palm")
    np.testing.assert_array_equal(residuals(z, target, start)[0, -N:], z[0])


def test_the_real_hand(shared, first_frame_mask):
    """A left palm: the thumb is at the left of the picture, the model fits within a pixel."""
    mask = first_frame_mask(shared / "clips" / "folding.mp4")
    found = calibrate_hand(mask, Camera.assumed_for(mask.shape[1], mask.shape[0]))
    peer = np.load(shared / "clips" / "folding_peer.npz")["kp2"][0]
    assert found.ok
    assert found.side == "left"
    assert found.residual_px < 1.0
    camera = Camera.assumed_for(mask.shape[1], mask.shape[0]).mirrored()
    here = camera.project(found.pose @ keypoints_mm(found.theta, found.shape))
    here[:, 0] = mask.shape[1] - 1 - here[:, 0]
    palm = np.linalg.norm(peer[9] - peer[0])
    off = np.linalg.norm(here - peer, axis=1) / palm
    assert off.mean() < 0.08
    assert off[4::4].max() < 0.15


@pytest.mark.parametrize("palm_for_fingers", [0.85, 1.0, 1.15])
def test_unusual_proportions_are_not_taken_for_a_tilt(open_hand, palm_for_fingers):
    """A long palm with short fingers looks as a usual one does that is tilted."""
    errors = []
    for seed in range(300, 312):
        rng = np.random.default_rng(seed)
        hand = open_hand(rng, tilt_deg=3.0, turn_deg=60.0, palm_for_fingers=palm_for_fingers)
        found = calibrate_hand(hand.mask, hand.camera)
        if found.ok:
            errors.append(np.degrees(rotation.angle_between(found.pose.R, hand.pose.R)))
    assert len(errors) >= 8
    assert max(errors) < 6


def test_a_thumb_that_points_at_the_camera_spoils_no_start(open_hand):
    """Thumbs look long or short as they please; fingers do not."""
    hand = open_hand(np.random.default_rng(3), tilt_deg=0.0)
    landmarks = calibrate_hand(hand.mask, hand.camera).landmarks
    tip, root = landmarks.tip_index[0], landmarks.valley_index[0]
    contour = landmarks.contour_px.copy()
    contour[tip] = contour[root] + 0.5 * (contour[tip] - contour[root])
    short = replace(landmarks, contour_px=contour)
    assert short.reach_r[0] < 0.6 * landmarks.reach_r[0]
    assert start_quality(short) >= 0.35


def test_a_hand_that_is_not_open_enough_is_refused(open_hand):
    hand = open_hand(np.random.default_rng(100), tilt_deg=5.0)
    quality = calibrate_hand(hand.mask, hand.camera).quality
    assert calibrate_hand(hand.mask, hand.camera, min_quality=quality).ok
    found = calibrate_hand(hand.mask, hand.camera, min_quality=quality + 0.01)
    assert found.status is Seen.HALF_OPEN
