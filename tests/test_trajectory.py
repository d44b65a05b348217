"""The waist: stacking, slicing, files, and the filters on it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from handtrack import rotation
from handtrack.errors import InputError, OutputError
from handtrack.output.provenance import write_provenance
from handtrack.output.table import TableWriter
from handtrack.records import FrameResult, Status
from handtrack.smoothing import (
    bridge_gaps,
    joint_velocity,
    palm_angular_velocity,
    resample,
    smooth,
    smooth_values,
)
from handtrack.tables import ANGLES_CSV, KEYPOINTS_CSV, RUN_JSON
from handtrack.trajectory import FRAME_SHAPES, Trajectory, angle_columns, keypoint_columns

SPIN = np.array([0.3, -1.1, 0.7])  # rad/s, camera frame
RATE = np.linspace(-1, 1, 20)  # rad/s


def result(k, time_s, status=Status.TRACKED):
    """A hand that turns at SPIN and bends at RATE."""
    if status in (Status.LOST, Status.UNDECODABLE):
        return FrameResult.unknown(k, time_s, status)
    points = np.arange(63.0).reshape(21, 3) + 10 * time_s
    return FrameResult(
        index=k,
        time_s=time_s,
        status=status,
        side="left",
        confidence=0.75,
        ess=40.0,
        R=rotation.exp(SPIN * time_s),
        t_mm=np.array([1.0, 2.0, 500.0]) * (1 + time_s),
        theta=0.2 + RATE * time_s,
        theta_std=np.full(20, 0.05),
        keypoints_px=points[:, :2],
        keypoints_mm=points,
    )


def hand_of(times_s, lost=()):
    return Trajectory.from_results(
        [result(k, t, Status.LOST if k in lost else Status.TRACKED) for k, t in enumerate(times_s)],
        {"clip": "a.mp4"},
    )


TIMES_S = np.cumsum([0, 0.03, 0.05, 0.04, 0.04, 0.1, 0.02, 0.04, 0.04, 0.04])


def test_stacking_keeps_everything():
    hand = hand_of(TIMES_S, lost={3})
    assert len(hand) == 10
    np.testing.assert_allclose(hand.palm_R[5], rotation.exp(SPIN * TIMES_S[5]), atol=1e-12)
    assert hand.is_status(Status.LOST).tolist() == [k == 3 for k in range(10)]
    assert np.isnan(hand.theta[3]).all()
    assert np.isnan(hand.palm_wxyz[3]).all()
    with pytest.raises(ValueError, match="read-only"):
        hand.theta[0] = 1


def test_empty_trajectory():
    assert len(Trajectory.from_results([])) == 0


def test_slices_and_masks():
    hand = hand_of(TIMES_S)
    assert hand[2:4].frame.tolist() == [2, 3]
    assert hand[hand.time_s > 0.3].frame.tolist() == [7, 8, 9]
    assert [one.frame.tolist() for one in hand][:2] == [[0], [1]]


def test_file_round_trip(tmp_path):
    hand = hand_of(TIMES_S, lost={0, 4})
    hand.save(tmp_path / "a.npz")
    back = Trajectory.load(tmp_path / "a.npz")
    for name in FRAME_SHAPES:
        np.testing.assert_array_equal(getattr(back, name), getattr(hand, name))
    assert dict(back.provenance) == {"clip": "a.mp4"}


def test_files_that_cannot_be(tmp_path):
    (tmp_path / "text.npz").write_text("no arrays here")
    np.savez(tmp_path / "pickle.npz", frame=np.array([{"a": 1}], object))
    for name in ("none.npz", "text.npz", "pickle.npz"):
        with pytest.raises(InputError, match=name):
            Trajectory.load(tmp_path / name)
    with pytest.raises(OutputError, match="cannot be written"):
        hand_of(TIMES_S).save(tmp_path / "no folder" / "a.npz")


def test_wrong_shapes_are_refused():
    hand = hand_of(TIMES_S)
    fields = {name: getattr(hand, name) for name in FRAME_SHAPES}
    with pytest.raises(InputError, match=r"theta has shape \(10, 19\)"):
        Trajectory(**fields | {"theta": hand.theta[:, 1:]})
    with pytest.raises(InputError, match="unknown status found"):
        Trajectory(**fields | {"status": np.full(10, "found")})


def test_dataframe_has_the_columns_of_the_table():
    pytest.importorskip("pandas")
    table = hand_of(TIMES_S).to_dataframe()
    assert table.columns[:7].tolist() == [
        *("frame", "time_s", "status", "side", "confidence", "ess"),
        "palm_x_mm",
    ]
    assert table["index_pip_flexion_deg"][2] == pytest.approx(
        np.degrees(0.2 + RATE[6] * TIMES_S[2])
    )


def test_smoothing_leaves_a_straight_line_and_a_steady_turn_alone():
    times_s = np.arange(21) * 0.04
    hand = hand_of(times_s)
    inner = slice(3, -3)
    calm = smooth(hand, 0.2)
    np.testing.assert_allclose(calm.theta[inner], hand.theta[inner], atol=1e-12)
    turn = rotation.angle_between(calm.palm_R[inner], hand.palm_R[inner])
    assert turn.max() < 1e-3
    assert calm.provenance["steps"] == ["smooth 0.2 s"]


def test_smoothing_takes_noise_away_and_keeps_unknown_unknown():
    times_s = np.arange(400) * 0.04
    noise = np.random.default_rng(3).normal(size=(400, 1))
    noise[100] = np.nan
    calm = smooth_values(times_s, noise, 0.4)
    assert np.isnan(calm).ravel().tolist() == [k == 100 for k in range(400)]
    m = 5  # a cone of m steps to each side leaves sum w^2 of the variance
    assert np.nanstd(calm) == pytest.approx(np.sqrt((2 * m**2 + 1) / (3 * m**3)), rel=0.15)


def test_smoothing_does_not_break_where_the_quaternion_changes_sign():
    hand = hand_of(np.arange(200) * 0.04)
    flipped = Trajectory(
        **{name: getattr(hand, name) for name in FRAME_SHAPES}
        | {"palm_wxyz": hand.palm_wxyz * np.where(np.arange(200) % 2, -1, 1)[:, None]}
    )
    turn = rotation.angle_between(smooth(flipped, 0.2).palm_R, hand.palm_R)[5:-5]
    assert turn.max() < 0.01


def test_short_gaps_are_bridged_and_long_ones_are_not():
    lost = {0, 3, 5, 6, 7}
    hand = hand_of(np.arange(10) * 0.04, lost)
    filled = bridge_gaps(hand, 0.1)
    assert filled.status.tolist() == [
        *("lost", "tracked", "tracked", "predicted", "tracked", "lost", "lost", "lost"),
        *("tracked", "tracked"),
    ]
    np.testing.assert_allclose(filled.theta[3], 0.2 + RATE * 0.12, atol=1e-12)
    np.testing.assert_allclose(filled.palm_R[3], rotation.exp(SPIN * 0.12), atol=1e-3)
    assert np.isnan(filled.theta_std[3]).all()
    assert filled.side[3] == "left"


def test_resampling_to_a_constant_rate():
    hand = hand_of(TIMES_S, lost={4})
    even = resample(hand, 100)
    np.testing.assert_allclose(np.diff(even.time_s), 0.01)
    known = np.isfinite(even.theta).all(axis=1)
    inside = (even.time_s > TIMES_S[3] + 1e-6) & (even.time_s < TIMES_S[5] - 1e-6)
    np.testing.assert_array_equal(known, ~inside)
    np.testing.assert_allclose(even.theta[known], 0.2 + RATE * even.time_s[known, None], atol=1e-12)
    assert set(even.status[inside]) == {"lost"}
    same = resample(hand_of(np.arange(9) / 30), 30)
    np.testing.assert_allclose(same.theta, hand_of(np.arange(9) / 30).theta, atol=1e-12)


def test_velocities_of_a_steady_motion():
    hand = hand_of(TIMES_S, lost={6})
    bend, turn = joint_velocity(hand), palm_angular_velocity(hand)
    known = np.isfinite(bend).all(axis=1)
    assert known.sum() >= 6
    np.testing.assert_allclose(bend[known], np.broadcast_to(RATE, (known.sum(), 20)), atol=1e-9)
    known = np.isfinite(turn).all(axis=1)
    assert known.sum() >= 6
    np.testing.assert_allclose(turn[known], np.broadcast_to(SPIN, (known.sum(), 3)), atol=1e-9)


def test_time_must_increase():
    with pytest.raises(InputError, match="time does not increase after frame 1"):
        smooth(hand_of([0, 0.04, 0.04, 0.08]), 0.2)
    with pytest.raises(InputError, match="not positive"):
        smooth(hand_of(TIMES_S), 0)


def test_a_whole_number_gives_one_frame():
    hand = hand_of(TIMES_S)
    assert hand[3].frame.tolist() == [3]
    assert hand[-1].frame.tolist() == [9]
    with pytest.raises(IndexError):
        hand[10]


def test_resampled_turns_are_exact_for_a_steady_turn():
    hand = hand_of(np.arange(6) * 0.4)  # half a radian from frame to frame
    fine = hand.resample(50)
    turn = rotation.angle_between(fine.palm_R, rotation.exp(SPIN * fine.time_s[:, None]))
    assert turn.max() < 1e-7


def test_slerp_against_scipy():
    rng = np.random.default_rng(5)
    a = rotation.to_quaternion(rotation.exp(rng.normal(size=(50, 3))))
    b = rotation.to_quaternion(rotation.exp(rng.normal(size=(50, 3))))
    b[:10] = rotation.to_quaternion(
        rotation.exp(1e-7 * rng.normal(size=(10, 3))) @ rotation.from_quaternion(a[:10])
    )
    b[10] = a[10]
    s = rng.random(50)
    got = rotation.from_quaternion(rotation.slerp(a, b, s))
    for k in range(50):
        ends = Rotation.from_quat(np.roll([a[k], b[k]], -1, axis=1))
        wanted = Slerp([0, 1], ends)(s[k]).as_matrix()
        np.testing.assert_allclose(got[k], wanted, atol=1e-12)


@pytest.mark.parametrize("times_s", [TIMES_S, np.arange(10) * 0.04])
def test_no_velocity_in_or_beside_a_gap(times_s):
    hand = hand_of(times_s, lost={4})
    unknown = [3, 4, 5]
    for velocity in (hand.joint_velocity(), palm_angular_velocity(hand)):
        assert np.flatnonzero(~np.isfinite(velocity).all(axis=1)).tolist() == unknown
        assert np.flatnonzero(~np.isfinite(velocity).any(axis=1)).tolist() == unknown


def test_velocity_of_a_parabola_is_exact_inside_whatever_the_steps():
    hand = hand_of(TIMES_S)
    fields = {name: getattr(hand, name) for name in FRAME_SHAPES}
    curved = Trajectory(**fields | {"theta": np.outer(TIMES_S**2, np.ones(20))})
    np.testing.assert_allclose(curved.joint_velocity()[1:-1, 0], 2 * TIMES_S[1:-1], atol=1e-12)


def test_methods_are_the_functions():
    hand = hand_of(TIMES_S, lost={4})
    for one, other in (
        (hand.smooth(0.2), smooth(hand, 0.2)),
        (hand.resample(60), resample(hand, 60)),
        (hand.bridge_gaps(0.2), bridge_gaps(hand, 0.2)),
    ):
        assert one.provenance == other.provenance
        for name in FRAME_SHAPES:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_folder_of_a_run_is_loaded_with_its_record(tmp_path):
    hand = hand_of(np.round(TIMES_S, 6), lost={4})
    for name, columns in ((ANGLES_CSV, angle_columns), (KEYPOINTS_CSV, keypoint_columns)):
        table = TableWriter(tmp_path / name, columns)
        table.write(hand)
        table.finish()
    with pytest.raises(InputError, match=r"no folder of a run \(it has no run\.json\)"):
        Trajectory.load(tmp_path)
    write_provenance(tmp_path / RUN_JSON, {"clip": "a.mp4"})
    back = Trajectory.load(tmp_path)
    assert back.provenance["clip"] == "a.mp4"
    np.testing.assert_array_equal(back.status, hand.status)
    np.testing.assert_allclose(back.theta, hand.theta, atol=1e-6)
    np.testing.assert_allclose(back.keypoints_mm, hand.keypoints_mm, atol=6e-5)


def test_dataframe_with_keypoints_has_both_tables():
    pytest.importorskip("pandas")
    hand = hand_of(TIMES_S)
    table = hand.to_dataframe(keypoints=True)
    assert table.columns.is_unique
    assert set(table.columns) == {*angle_columns(hand), *keypoint_columns(hand)}
