"""BVH: exact round trips, forward kinematics in closed form, and errors that name the line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.errors import InputError, OutputError
from handtrack.mocap.bvh import Motion, format_bvh, parse_bvh, read_bvh, write_bvh

TWO_JOINTS = """HIERARCHY
ROOT hand root
{
  OFFSET 1.5 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT hinge {
    OFFSET 0 2 0
    CHANNELS 1 Xrotation
    End Site
    {
      OFFSET 0 3 0.25
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0083333
0 0 0 0 0 0 0
10 20 30 90 0 0 90
1 2 3 -170.5 12.25 359.9 -45.125
"""


def random_motion(rng: np.random.Generator) -> Motion:
    """Five joints in two branches, of which one has three axes, one a hinge and one none."""
    return Motion(
        names=("root", "a", "b", "c", "d"),
        parents=np.array([-1, 0, 1, 0, 3]),
        offsets=rng.normal(size=(5, 3)),
        channels=(
            ("Xposition", "Yposition", "Zposition", "Yrotation", "Xrotation", "Zrotation"),
            ("Zrotation", "Xrotation"),
            ("Xrotation",),
            (),
            ("Xrotation", "Yrotation", "Zrotation"),
        ),
        end_parents=np.array([2, 4, 0]),
        end_offsets=rng.normal(size=(3, 3)),
        frame_time_s=1 / 119.88,
        values=rng.normal(scale=100, size=(7, 12)),
    )


def test_round_trip_keeps_every_number(tmp_path: Path) -> None:
    motion = random_motion(np.random.default_rng(0))
    write_bvh(motion, tmp_path / "étude 1.bvh")
    back = read_bvh(tmp_path / "étude 1.bvh")
    assert (back.names, back.channels) == (motion.names, motion.channels)
    assert back.frame_time_s == motion.frame_time_s
    for name in ("parents", "offsets", "values"):
        np.testing.assert_array_equal(getattr(back, name), getattr(motion, name))
    ends = {int(p): o.tolist() for p, o in zip(back.end_parents, back.end_offsets, strict=True)}
    assert ends == {
        int(p): o.tolist() for p, o in zip(motion.end_parents, motion.end_offsets, strict=True)
    }
    assert format_bvh(parse_bvh(format_bvh(back))) == format_bvh(back)


def test_joints_in_any_order_are_written_depth_first() -> None:
    motion = random_motion(np.random.default_rng(3))
    order = [0, 1, 3, 2, 4]  # breadth first
    columns = [c for j in order for c in range(12)[motion.columns(j)]]
    shuffled = replace(
        motion,
        names=tuple(motion.names[j] for j in order),
        parents=np.array([-1, 0, 0, 1, 2]),
        offsets=motion.offsets[order],
        channels=tuple(motion.channels[j] for j in order),
        end_parents=np.array([3, 4, 0]),
        values=motion.values[:, columns],
    )
    assert format_bvh(shuffled) == format_bvh(motion)


def test_forward_kinematics_in_closed_form() -> None:
    world = parse_bvh(TWO_JOINTS).world()
    # frame 0: the position channels stand in place of the root's offset
    np.testing.assert_allclose(world.joints[0], [[0, 0, 0], [0, 2, 0]], atol=1e-12)
    # frame 1: Rz(90) takes y to -x; Rx(90) takes y to z before it
    np.testing.assert_allclose(world.joints[1], [[10, 20, 30], [8, 20, 30]], atol=1e-12)
    np.testing.assert_allclose(world.ends[1, 0], [8.25, 20, 33], atol=1e-12)


def test_rotations_multiply_in_file_order() -> None:
    motion = random_motion(np.random.default_rng(1))
    R = motion.local_rotations()
    reference = Rotation.from_euler("YXZ", motion.values[:, 3:6], degrees=True).as_matrix()
    np.testing.assert_allclose(R[:, 0], reference, atol=1e-12)
    reference = Rotation.from_euler("ZX", motion.values[:, 6:8], degrees=True).as_matrix()
    np.testing.assert_allclose(R[:, 1], reference, atol=1e-12)


def test_bones_keep_their_lengths() -> None:
    motion = random_motion(np.random.default_rng(2))
    world = motion.world()
    for j in (1, 2, 3, 4):
        bone = np.linalg.norm(world.joints[:, j] - world.joints[:, motion.parents[j]], axis=-1)
        np.testing.assert_allclose(bone, np.linalg.norm(motion.offsets[j]), atol=1e-12)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (
            lambda t: t.replace("10 20 30 90 0 0 90", "10 20 30 90 0 0"),
            "line 19: 6 values.*7 channels",
        ),
        (lambda t: t.replace("12.25", "twelve"), "line 20: 'twelve' is not a number"),
        (lambda t: t.replace("12.25", "nan"), "line 20: a value that is not finite"),
        (lambda t: t.replace("Frames: 3", "Frames: 4"), "ends after 3 of the 4 frames"),
        (lambda t: t.replace("Frames: 3", "Frames: 2"), "line 20: a motion line beyond"),
        (lambda t: t.replace("Frame Time: 0.0083333", "Frame Time: 0"), "line 16: wanted"),
        (
            lambda t: t.replace("CHANNELS 1 Xrotation", "CHANNELS 2 Xrotation"),
            "line 8: cannot read",
        ),
        (
            lambda t: t.replace("CHANNELS 1 Xrotation", "CHANNELS 1 Wrotation"),
            "line 8: cannot read",
        ),
        (lambda t: t.replace("OFFSET 0 2 0", "OFFSET 0 2"), "line 7: cannot read"),
        (lambda t: t[: t.index("MOTION")], "ends before MOTION"),
        (lambda t: t.replace("}\nMOTION", "MOTION"), "not closed"),
        (lambda t: t.replace("}\nMOTION", "}}\nMOTION"), "line 14: cannot read"),
        (lambda t: "", "not a BVH"),
        (lambda t: "hello\nworld", "not a BVH"),
    ],
)
def test_damage_is_named(damage, says, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "damaged.bvh"
    path.write_text(damage(TWO_JOINTS), encoding="utf-8")
    with pytest.raises(InputError, match=says) as caught:
        read_bvh(path)
    assert "damaged.bvh" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_old_and_foreign_text_is_read(tmp_path: Path) -> None:
    for name, content in (
        ("latin.bvh", TWO_JOINTS.replace("hinge", "Gelänk").encode("latin-1")),
        ("bom.bvh", b"\xef\xbb\xbf" + TWO_JOINTS.replace("hinge", "Gelänk").encode()),
        ("dos.bvh", TWO_JOINTS.replace("hinge", "Gelänk").replace("\n", "\r\n").encode()),
        ("tabs.bvh", TWO_JOINTS.replace("hinge", "Gelänk").replace(": ", ":\t").encode()),
    ):
        (tmp_path / name).write_bytes(content)
        motion = read_bvh(tmp_path / name)
        assert motion.names == ("hand root", "Gelänk")
        assert motion.values[2, 6] == -45.125


def test_missing_binary_and_folder(tmp_path: Path) -> None:
    (tmp_path / "video.bvh").write_bytes(b"\x00\xff\xfe\x80" * 10)
    for name in ("absent.bvh", "video.bvh", "."):
        with pytest.raises(InputError):
            read_bvh(tmp_path / name)


def test_write_leaves_nothing_half_written(tmp_path: Path) -> None:
    motion = parse_bvh(TWO_JOINTS)
    with pytest.raises(OutputError):
        write_bvh(motion, tmp_path / "no such folder" / "x.bvh")
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError):
        write_bvh(motion, tmp_path / "taken")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_record_is_read_only_and_checked() -> None:
    motion = parse_bvh(TWO_JOINTS)
    with pytest.raises(ValueError, match="read-only"):
        motion.values[0, 0] = 1
    with pytest.raises(InputError, match=r"no joint 'thumb'.*hand root, hinge"):
        motion.index("thumb")
