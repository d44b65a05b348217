"""Recordings: anatomy of what is read, on small files made here and on the real sets if present."""

import json
from pathlib import Path

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import ANGLE_NAMES, LIMITS
from handtrack.mocap.recordings import (
    LEAP_YAW_DEG,
    read_folder,
    read_intel,
    read_leap,
    read_manipnet,
    resampled,
    shipped_motion,
    trusted,
)

FLEXIONS = [k for k, name in enumerate(ANGLE_NAMES) if name.endswith("flexion") and k >= 4]


def leap_file(path: Path, theta: np.ndarray, side: str = "right", confidence: float = 1.0) -> Path:
    """A Leap Motion recording of our own hand at ``theta`` ``(F, 20)``, turned and moved."""
    rng = np.random.default_rng(0)
    frames = []
    for f, points in enumerate(keypoints_mm(theta, HandShape.default())):
        R = rotation.exp(rng.normal(size=3))
        mirror = np.diag([-1.0 if side == "left" else 1.0, 1, 1])
        yaw = rotation.about_z(np.radians(-LEAP_YAW_DEG))
        placed = points @ (R @ mirror @ yaw).T + [10, 200, 30]
        digits = placed[1:].reshape(5, 4, 3).tolist()
        frames.append(
            {
                "timestamp": 1_000_000 + f * 10_000,
                "hands": [
                    {
                        "id": 7,
                        "type": side,
                        "confidence": confidence,
                        "direction": R[:, 1].tolist(),
                        "palmNormal": R[:, 2].tolist(),
                    }
                ],
                "pointables": [
                    dict(
                        zip(
                            ("mcpPosition", "pipPosition", "dipPosition", "tipPosition"),
                            digit,
                            strict=True,
                        )
                    )
                    | {"type": d, "handId": 7}
                    for d, digit in enumerate(digits)
                ],
            }
        )
    path.write_text(json.dumps({"frames": frames}), encoding="utf-8")
    return path


@pytest.mark.parametrize("side", ["right", "left"])
def test_leap_reads_back_a_known_hand(side: str, tmp_path: Path) -> None:
    theta = np.tile(np.radians([10, 5, 15, 20, *[20, 8, 30, 25] * 4]), (5, 1))
    theta += np.linspace(0, 0.05, 5)[:, None]
    (recording,) = read_leap(leap_file(tmp_path / "a.json", theta, side))
    assert (recording.side, recording.ok.all()) == (side, True)
    assert np.degrees(np.abs(recording.theta - theta)).max() < 1.0
    np.testing.assert_allclose(recording.time_s, np.arange(5) * 0.01, atol=1e-9)


def test_unsure_and_jumping_frames_are_not_ok(tmp_path: Path) -> None:
    theta = np.zeros((6, 20))
    theta[3:, 6] = 1.5  # 86 deg in 10 ms
    (recording,) = read_leap(leap_file(tmp_path / "a.json", theta))
    assert recording.ok.tolist() == [True, True, False, False, True, True]
    (unsure,) = read_leap(leap_file(tmp_path / "b.json", theta, confidence=0.3))
    assert not unsure.ok.any()


def test_frames_outside_the_limits_or_out_of_plane_are_not_ok() -> None:
    theta, out = np.zeros((3, 20)), np.zeros((3, 5))
    theta[0, 6] = LIMITS[6, 1] + np.radians(16)
    out[1, 2] = np.radians(21)
    ok = trusted(theta, np.full(3, np.nan), out, np.ones(3, bool))
    assert ok.tolist() == [False, False, True]


@pytest.mark.parametrize("read", [read_leap, read_intel, read_manipnet])
def test_what_is_no_recording_is_refused_in_one_line(read, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    for name, text in (
        ("a", "1 2 3\n"),
        ("b", '{"frames": [{"hands": [{}]}]}'),
        ("c", ""),
        ("d", "0 " * 119),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as caught:
            read(tmp_path / name)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="absent"):
        read(tmp_path / "absent")


def test_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no leap recordings"):
        read_folder("leap", tmp_path)


def test_shipped_motion_is_varied_and_humanly_possible() -> None:
    motion = shipped_motion()
    theta = np.degrees(motion.theta)
    assert len(theta) > 900
    assert (motion.theta >= LIMITS[:, 0] - 1e-3).all()
    assert (motion.theta <= LIMITS[:, 1] + 1e-3).all()
    assert np.ptp(theta[:, FLEXIONS], axis=0).min() > 45  # every finger joint opens and bends
    assert np.abs(np.diff(theta, axis=0)).max() * 30 < 1000  # deg/s
    curled = theta[:, 6::4] > 60
    assert {(0, 1, 1, 1), (1, 1, 1, 1), (0, 0, 0, 0)} <= {tuple(map(int, row)) for row in curled}
    assert motion.licence == "Apache-2.0"


def test_resampling_keeps_to_frames_that_are_ok(tmp_path: Path) -> None:
    theta = np.zeros((6, 20))
    theta[3:, 6] = 1.5
    (recording,) = read_leap(leap_file(tmp_path / "a.json", theta))
    middle = resampled(recording, [0.025])[0, 6]
    assert middle == pytest.approx(0.75, abs=0.01)  # between frames 1 and 4, linearly


@pytest.mark.parametrize(
    ("kind", "n_frames", "pip_max_deg"),
    [("leap", 3500, 80), ("intel", 2336, 100), ("manipnet", 50_000, 110)],
)
def test_real_sets_are_anatomical(
    kind: str, n_frames: int, pip_max_deg: float, shared: Path
) -> None:
    recordings = read_folder(kind, shared / "data" / kind)
    theta = np.degrees(np.concatenate([r.clean for r in recordings]))
    assert len(theta) >= n_frames
    low, middle, high = np.percentile(theta, [1, 50, 99], axis=0)
    assert (low[FLEXIONS] > -26).all()  # fingers bend to the palm
    assert (high[4::4] > 50).all()
    assert (np.abs(middle[5::4]) < 9).all()  # and stand about parallel to their metacarpals
    assert (high[6::4] > 70).all()
    assert theta[:, 6].max() == pytest.approx(pip_max_deg, abs=8)
    out = np.concatenate([r.ok for r in recordings])
    assert out.mean() > 0.9 or kind == "leap"
