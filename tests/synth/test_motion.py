"""Motion: seeded, smooth, inside its limits; lines between states, and off them."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.hand.skeleton import LIMITS
from synth.motion import FRONTAL, Motion
from synth.waves import minimum_jerk


def film(motion: Motion, seed: int = 0, subframes: int = 1):
    return motion.film(np.random.default_rng(seed), 30.0, subframes)


@pytest.mark.parametrize("fingers", ["states", "curls", "recording", "still"])
def test_motion_is_smooth_and_inside_the_limits(fingers) -> None:
    got = film(Motion(fingers=fingers, frames=150))
    assert (got.theta >= LIMITS[:, 0]).all()
    assert (got.theta <= LIMITS[:, 1]).all()
    assert np.abs(np.diff(got.theta, axis=0)).max() < np.radians(30)
    assert np.abs(np.diff(got.t_mm, axis=0)).max() < 12
    first = got.theta[:10]
    assert np.ptp(first, axis=0).max() < 1e-9  # held open
    if fingers != "still":
        assert np.ptp(got.theta, axis=0).max() > np.radians(50)


def test_seeds_decide() -> None:
    a, b, c = film(Motion(), 1), film(Motion(), 1), film(Motion(), 2)
    assert (a.theta == b.theta).all()
    assert (a.R == b.R).all()
    assert np.abs(a.theta - c.theta).max() > 0.1


@pytest.mark.parametrize("tilt_deg", [0.0, 15.0, 40.0])
def test_the_tilt_reaches_its_limit_and_no_more(tilt_deg) -> None:
    got = film(Motion(tilt_deg=tilt_deg, roll_deg=0.0, frames=300), 4)
    out_of_plane = np.degrees(np.arccos(np.clip(-got.R[:, 2, 2], -1, 1)))
    assert out_of_plane.max() <= tilt_deg + 1e-6
    assert out_of_plane.max() >= 0.85 * tilt_deg
    assert np.degrees(rotation.angle_between(FRONTAL, got.R[0])) < 1e-6


def test_subframes_lie_between_frames() -> None:
    motion = Motion(frames=20)
    one, many = film(motion), film(motion, subframes=4)
    assert len(many.theta) == 80
    middle = many.t_mm.reshape(20, 4, 3).mean(axis=1)
    assert np.abs(middle - one.t_mm).max() < 0.5
    assert (np.diff(many.times_s) > 0).all()


def test_curls_bend_each_joint_alone() -> None:
    theta = film(Motion(fingers="curls", frames=600, open_frames=0)).theta
    between = np.corrcoef(theta[:, 6], theta[:, 7])[0, 1]  # index PIP, DIP
    assert abs(between) < 0.8


def test_states_go_along_straight_lines() -> None:
    theta = film(Motion(frames=120, open_frames=5), 3).theta
    moving = np.linalg.norm(np.diff(theta, axis=0), axis=1)
    runs = np.split(theta, np.flatnonzero(moving < 1e-9) + 1)
    longest = max(runs, key=len)
    along = longest[-1] - longest[0]
    along /= np.linalg.norm(along)
    off = longest - longest[0] - np.outer((longest - longest[0]) @ along, along)
    assert len(longest) >= 8
    assert np.abs(off).max() < np.radians(0.5)


def test_minimum_jerk_ends_at_rest() -> None:
    s = np.linspace(0, 1, 1001)
    step = np.gradient(minimum_jerk(s), s)
    assert abs(step[0]) < 1e-4
    assert step.max() == pytest.approx(1.875, abs=1e-3)


def test_the_hand_leaves() -> None:
    got = film(Motion(frames=100, away=(0.4, 0.7), move_mm=(0.0, 0.0, 0.0)))
    assert got.t_mm[50, 0] - got.t_mm[5, 0] > 400
    assert abs(got.t_mm[99, 0] - got.t_mm[5, 0]) < 60
