"""The excerpt of recorded motion: seamless, and what ships is what the command makes."""

from pathlib import Path

import numpy as np
import pytest

from handtrack.errors import InputError, OutputError
from handtrack.hand.commands import SpaceExcerpt
from handtrack.mocap.excerpt import excerpt, minimum_jerk, save_excerpt
from handtrack.mocap.recordings import Recording, shipped_motion

NAMES = ("HandSplay-110fps", "grab", "pinch", "Waiting-110fps", "gun", "flapping", "wave")


def recordings() -> list[Recording]:
    """Stand-ins for all recordings that the plan names, each a slow wave of its own."""
    made = []
    for k, (name, n) in enumerate([*((f"{n} (right)", 400) for n in NAMES), ("animbank", 2336)]):
        time_s = np.arange(n) / 110
        theta = 0.2 + 0.1 * np.sin(time_s[:, None] + k) * np.ones(20)
        times = np.full(n, np.nan) if name == "animbank" else time_s
        made.append(Recording(name, "right", theta, times, np.ones(n, bool), f"set {k}", "free"))
    return made


def test_minimum_jerk_is_at_rest_at_both_ends() -> None:
    s = np.array([0.0, 1e-4, 0.5, 1 - 1e-4, 1.0])
    np.testing.assert_allclose(minimum_jerk(s), [0, 1e-11, 0.5, 1, 1], atol=2e-11)


def test_pieces_join_without_a_step() -> None:
    theta, rate_hz = excerpt(recordings())
    assert rate_hz == 30
    assert np.abs(np.diff(theta, axis=0)).max() < 0.06
    assert len(theta) > 900


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no recording 'animbank'"):
        excerpt(recordings()[:-1])
    with pytest.raises(OutputError):
        save_excerpt(tmp_path / "no folder" / "m.npz", recordings())


def test_what_ships_is_what_the_command_makes(shared: Path, tmp_path: Path) -> None:
    data, out = shared / "data", tmp_path / "m.npz"
    assert SpaceExcerpt(leap=data / "leap", intel=data / "intel", out=out)() == 0
    with np.load(out) as made:
        np.testing.assert_allclose(
            np.radians(made["theta_cdeg"] / 100), shipped_motion().theta, atol=np.radians(0.011)
        )
