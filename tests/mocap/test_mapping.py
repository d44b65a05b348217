"""Mappings: exact on our own skeleton, invariant to where the hand is, refusals by name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import LIMITS
from handtrack.mocap.bvh import Motion, parse_bvh
from handtrack.mocap.mapping import SHIPPED, in_palm_frame, read_mapping
from handtrack.output.bvh import hand_motion

RNG = np.random.default_rng(0)
THETA = RNG.uniform(LIMITS[:, 0], LIMITS[:, 1], (40, 20))
TURN = rotation.exp(RNG.normal(size=(40, 3)))
PLACE = RNG.normal(scale=100, size=(40, 3))


def our_motion(side: str = "right") -> Motion:
    return hand_motion(THETA, TURN, PLACE, HandShape.default(), side)


@pytest.mark.parametrize("side", ["right", "left"])
def test_our_own_skeleton_reads_back_exactly(side: str) -> None:
    theta, out_of_plane = read_mapping("handtrack").theta(our_motion(side))
    np.testing.assert_allclose(theta, THETA, atol=np.radians(1e-9))
    assert not out_of_plane.any()


@pytest.mark.parametrize("mirror", [1, -1])
def test_palm_frame_undoes_any_placement_and_mirror(mirror: int) -> None:
    theta = np.abs(THETA)  # fingers curl to the palm, which tells its front from its back
    points = keypoints_mm(theta, HandShape.default())
    placed = np.einsum("fab,fkb->fka", TURN, points * [mirror, 1, 1]) + PLACE[:, None]
    back = in_palm_frame(placed)
    np.testing.assert_allclose(back[:, [0, 9]], points[:, [0, 9]], atol=1e-9)
    np.testing.assert_allclose(back, points, atol=1e-9)


def test_keypoints_of_a_foreign_skeleton_give_the_angles() -> None:
    """Our own hand, read by positions as if its channels were unknown."""
    keypoints = {
        "wrist": "wrist",
        **{f"thumb_{j}": f"thumb_{j}" for j in ("cmc", "mcp", "ip")},
        **{
            f"{d}_{j}": f"{d}_{j}"
            for d in ("index", "middle", "ring", "little")
            for j in ("mcp", "pip", "dip")
        },
    }
    mapping = replace(read_mapping("manipnet"), keypoints=keypoints, unit_mm=1.0, yaw_deg=0.0)
    theta = np.clip(np.abs(THETA), 0.1, 1.0)
    theta[:, ::4] *= 0.6  # fingers out of the palm show little of their abduction
    for side in ("right", "left"):
        found, out = mapping.theta(hand_motion(theta, TURN, PLACE, HandShape.default(), side))
        off_deg = np.degrees(np.abs(found - theta))
        assert (off_deg.max() < 6, off_deg.mean() < 0.3) == (True, True)  # damping: abductions
        assert np.degrees(out).max() < 3


def test_a_joint_that_is_not_there_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"names INDEX_DIP_FE.*which the skeleton does not have"):
        read_mapping("manipnet").theta(our_motion())
    motion = our_motion()
    channels = (*motion.channels[:2], (), *motion.channels[3:])
    values = np.delete(motion.values, motion.columns(2), axis=1)
    with pytest.raises(InputError, match="thumb_cmc_flexion from Xrotation of thumb_cmc"):
        read_mapping("handtrack").theta(replace(motion, channels=channels, values=values))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("format = 3", "not a mapping"),
        ("= nonsense", "not a TOML file"),
        ('format = "handtrack-mapping"', "missing key skeleton"),
        ('format = "handtrack-mapping"\nskeleton = "s"', "either"),
        ('format = "handtrack-mapping"\nskeleton = "s"\ncolour = 1', "unknown key colour"),
        (
            'format = "handtrack-mapping"\nskeleton = "s"\n[keypoints]\nnose = "N"',
            "unknown keypoint nose",
        ),
        (
            'format = "handtrack-mapping"\nskeleton = "s"\n[keypoints]\nwrist = "N"',
            "missing keypoint index_dip",
        ),
    ],
)
def test_bad_mapping_files(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        read_mapping(tmp_path / "m.toml")
    with pytest.raises(InputError, match="shipped ones are manipnet, handtrack"):
        read_mapping(tmp_path / "absent.toml")


def test_shipped_mappings_load() -> None:
    assert all(read_mapping(name).skeleton for name in SHIPPED)


def test_zero_end_site_needs_a_length() -> None:
    text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\nEnd Site\n{\nOFFSET 0 0 0\n}\n}\n"
    motion = parse_bvh(text + "MOTION\nFrames: 0\nFrame Time: 0.1\n")
    mapping = replace(
        read_mapping("manipnet"), keypoints=dict.fromkeys(read_mapping("manipnet").keypoints, "a")
    )
    with pytest.raises(InputError, match="End Site of a is at zero"):
        replace(mapping, tip_mm=()).theta(motion)
