"""Virtual markers: glued to their bones, on either hand, with noise and dropouts as asked."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import KEYPOINT_NAMES
from handtrack.mocap.alphabet import key_poses, perform, sequences
from handtrack.mocap.attach import attach, disturbed, find_mapping, palm_of
from handtrack.mocap.bvh import Motion
from handtrack.mocap.hand_motion import hand_motion
from handtrack.mocap.marker_sets import marker_set
from handtrack.mocap.markers import Markers

FULL = marker_set("full13")


@pytest.fixture(scope="module")
def theta() -> np.ndarray:
    return perform("girl", np.random.default_rng(0))[::4]


def motion_of(theta, side="right", seed=0) -> Motion:
    rng = np.random.default_rng(seed)
    R, t = rotation.exp(rng.normal(size=(len(theta), 3))), rng.normal(0, 300, (len(theta), 3))
    return hand_motion(theta, R, t, HandShape.default(), side, 1 / 120)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_palm_is_found_in_the_world(theta, side):
    motion = motion_of(theta, side)
    palm = palm_of(motion_keypoints(motion))
    world = motion.world()
    assert palm.side == side
    np.testing.assert_allclose(palm.R, world.R[:, 0], atol=1e-9)
    np.testing.assert_allclose(palm.t_mm, world.joints[:, 0], atol=1e-9)
    assert palm.length_mm == pytest.approx(HandShape.default().palm_length_mm)


def motion_keypoints(motion: Motion) -> np.ndarray:
    world = motion.world()
    points = np.empty((motion.n_frames, 21, 3))
    for k, name in enumerate(KEYPOINT_NAMES):
        tip = name.endswith("_tip")
        at = world.ends[:, k // 4 - 1] if tip else world.joints[:, motion.index(name)]
        points[:, k] = at
    return points


@pytest.mark.parametrize("side", ["right", "left"])
def test_markers_keep_their_distance_from_their_bone(theta, side):
    motion = motion_of(theta, side)
    markers = attach(motion, find_mapping(motion), FULL)
    points = motion_keypoints(motion)
    for label in FULL.markers:
        site = FULL.sites[label]
        k = KEYPOINT_NAMES.index(site.bone)
        foot = points[:, k] + site.along * (points[:, k + 1] - points[:, k])
        gap = markers.select([label]).positions_mm[:, 0] - foot
        np.testing.assert_allclose(np.linalg.norm(gap, axis=1), site.dorsal_mm, atol=1e-6)
        np.testing.assert_allclose(
            np.einsum("fa,fa->f", gap, points[:, k + 1] - points[:, k]), 0, atol=1e-6
        )


def test_markers_are_on_the_back_of_the_hand(theta):
    motion = motion_of(theta)
    markers = attach(motion, find_mapping(motion), FULL)
    palm = palm_of(motion_keypoints(motion))
    for label in FULL.root:
        at = markers.select([label]).positions_mm[:, 0] - palm.t_mm
        local = np.einsum("fba,fb->fa", palm.R, at)
        np.testing.assert_allclose(local, np.tile(local[0], (len(local), 1)), atol=1e-8)
        assert local[0, 2] < -10


def test_the_places_are_the_skeletons_and_not_the_clips(theta):
    whole = motion_of(theta)
    markers = attach(whole, find_mapping(whole), FULL)
    for rows in (slice(0, 40), slice(60, None, 3)):
        part = replace(whole, values=whole.values[rows])
        got = attach(part, find_mapping(part), FULL)
        np.testing.assert_allclose(got.positions_mm, markers.positions_mm[rows], atol=0.05)


def test_a_left_hand_has_the_mirrored_markers(theta):
    right, left = (motion_of(theta, side) for side in ("right", "left"))
    in_palm = []
    for motion in (right, left):
        palm = palm_of(motion_keypoints(motion))
        at = attach(motion, find_mapping(motion), FULL).positions_mm - palm.t_mm[:, None]
        in_palm.append(np.einsum("fba,fmb->fma", palm.R, at))
    np.testing.assert_allclose(in_palm[1], in_palm[0] * [-1, 1, 1], atol=1e-7)


def test_a_recorded_right_hand_is_a_right_hand(shared):
    from handtrack.mocap.bvh import read_bvh

    motion = read_bvh(shared / "data/manipnet/cup1_right.bvh")
    markers = attach(motion, find_mapping(motion), FULL)
    x, y, z = (
        markers.select([name]).positions_mm[:, 0]
        for name in ("root_wrist", "root_index", "root_little")
    )
    # seen from the back of the hand, wrist -> index -> little turns left on a right hand's palm
    back = np.cross(y - x, z - x)
    curl = markers.select(["middle_tip"]).positions_mm[:, 0] - y
    assert np.median(np.einsum("fa,fa->f", back, curl)) > 0


def test_noise_and_dropouts_are_as_asked_and_seeded():
    still = Markers(("a", "b"), np.zeros((6000, 2, 3)), 120.0)
    got = disturbed(still, np.random.default_rng(1), noise_mm=0.5, dropout=0.1)
    again = disturbed(still, np.random.default_rng(1), noise_mm=0.5, dropout=0.1)
    np.testing.assert_array_equal(got.positions_mm, again.positions_mm)
    assert 1 - got.seen.mean() == pytest.approx(0.1, abs=0.03)
    assert np.nanstd(got.positions_mm) == pytest.approx(0.5, abs=0.02)
    lengths = [gap.last - gap.first + 1 for gap in got.gaps()]
    assert np.mean(lengths) == pytest.approx(12, abs=4)
    with pytest.raises(InputError, match="share"):
        disturbed(still, np.random.default_rng(1), dropout=1.0)


def test_a_skeleton_that_no_mapping_fits(theta):
    motion = motion_of(theta)
    other = Motion(
        **{f: getattr(motion, f) for f in motion.__dataclass_fields__}
        | {"names": tuple(f"j{k}" for k in range(len(motion.names)))}
    )
    with pytest.raises(InputError, match=r"no shipped mapping .* fits this skeleton of j0"):
        find_mapping(other)
    with pytest.raises(InputError, match="which the skeleton does not have"):
        find_mapping(motion, "manipnet")
    with pytest.raises(InputError, match="no marker set 'full9'; there are full13"):
        marker_set("full9")


def test_key_poses_are_distinct_and_inside_the_limits():
    from handtrack.hand.skeleton import LIMITS

    poses = key_poses()
    letters = [poses[chr(65 + k)] for k in range(26)]
    stacked = np.array(list(poses.values()))
    assert (stacked >= LIMITS[:, 0]).all()
    assert (stacked <= LIMITS[:, 1]).all()
    apart = np.degrees(abs(np.array(letters)[:, None] - np.array(letters)).max(axis=2))
    shared_by = {(i, j) for i, j in np.argwhere(apart < 8) if i < j}
    # I and J, L and nothing else: J is I in motion; all other letters differ by 8 deg somewhere
    assert shared_by <= {(8, 9)}


@pytest.mark.parametrize(
    ("letter", "fingers"), [("F", ["index"]), ("O", ["index", "middle"]), ("D", ["middle"])]
)
def test_thumb_meets_the_fingers_it_should(letter, fingers):
    points = keypoints_mm(key_poses()[letter], HandShape.default())
    tips = points[[KEYPOINT_NAMES.index(f"{finger}_tip") for finger in fingers]]
    assert np.linalg.norm(points[4] - tips.mean(axis=0)) < 15  # two half thicknesses


def test_performances_are_smooth_seeded_and_varied():
    first = perform("alphabet", np.random.default_rng(0), runs=2)
    np.testing.assert_array_equal(first, perform("alphabet", np.random.default_rng(0), runs=2))
    other = perform("alphabet", np.random.default_rng(1), runs=2)
    assert len(first) != len(other)
    assert np.degrees(abs(np.diff(first, axis=0)).max()) < 15
    assert 20 < len(first) / 120 < 50
    assert {"alphabet", "girl", "walk", "counting", "gestures"} <= set(sequences())
    with pytest.raises(InputError, match="no sequence 'dance'"):
        perform("dance", np.random.default_rng(0))
