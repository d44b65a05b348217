"""Fitting the space: seeded, basis states by a rule, draws inside the limits, the commands."""

from pathlib import Path

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.hand.basis import choose_basis, curls, pattern_support, unnatural
from handtrack.hand.commands import SpaceFit, SpaceReport
from handtrack.hand.fit import RecordedSet, fit_space, kept_by
from handtrack.hand.sample import draw_curls, draw_sample, draw_walks, thin
from handtrack.hand.skeleton import LIMITS
from handtrack.hand.space import ALL_PATTERNS, default, load, state_name
from handtrack.mocap.recordings import shipped_motion

OPEN, FIST = np.zeros(20), np.radians([30, 10, 25, 60, *[85, 0, 100, 60] * 4])


def recorded(n: int = 600, seed: int = 0) -> RecordedSet:
    """Recordings in which fingers curl one by one, made here."""
    rng = np.random.default_rng(seed)
    patterns = ALL_PATTERNS[~unnatural(ALL_PATTERNS)]
    c = np.repeat(patterns[rng.integers(len(patterns), size=n)], 4, axis=1)
    theta = np.where(c, FIST, OPEN) + rng.normal(scale=0.05, size=(n, 20))
    return RecordedSet("made here", "none", np.clip(theta, LIMITS[:, 0], LIMITS[:, 1]))


def test_same_seed_same_space_other_seed_other_space() -> None:
    fits = [fit_space([recorded()], samples=2000, seed=seed) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(fits[0].covariance, fits[1].covariance)
    assert np.abs(fits[0].covariance - fits[2].covariance).max() > 1e-6


def test_the_states_without_support_fall() -> None:
    """Of 32 patterns one never occurs, and it is not an unnatural one."""
    absent = ALL_PATTERNS[0b01000]  # only the index curled
    c = ALL_PATTERNS[np.arange(3200) % 32]
    theta = np.where(np.repeat(c[(c != absent).any(axis=1)], 4, axis=1), FIST, OPEN)
    basis = choose_basis([theta], keep=31)
    kept = {state_name(state) for state in basis.states}
    assert {state_name(p) for p in ALL_PATTERNS} - kept == {"-I---"}
    np.testing.assert_allclose(basis.support.sum(), 1)


def test_among_equals_the_unnatural_fall_first() -> None:
    basis = choose_basis([recorded().theta], keep=28)
    kept = {state_name(state) for state in basis.states}
    fallen = {state_name(p) for p in ALL_PATTERNS} - kept
    assert fallen == {"--M-L", "-IM-L", "T-M-L", "TIM-L"}
    assert len(choose_basis([recorded().theta], keep=32).states) == 32


def test_extended_and_curled_are_the_ends_of_the_recordings() -> None:
    basis = choose_basis([recorded(5000).theta])
    flexions = np.arange(20) % 4 != 1
    np.testing.assert_allclose(basis.extended[flexions], OPEN[flexions], atol=0.06)
    np.testing.assert_allclose(basis.curled[flexions], FIST[flexions], atol=0.06)


def test_curls_and_supports() -> None:
    half = (OPEN + FIST) / 2
    c = curls(np.stack([OPEN, half, FIST, 2 * FIST]), OPEN, FIST)
    np.testing.assert_allclose(c, np.array([0, 0.5, 1, 1])[:, None] * np.ones(5), atol=1e-12)
    hard, soft = pattern_support(c[[0, 2]])
    assert hard[[0, 31]].tolist() == [0.5, 0.5]
    np.testing.assert_allclose(soft, hard, atol=1e-12)
    np.testing.assert_allclose(pattern_support(c[[1]])[1], 1 / 32, atol=1e-12)


def test_draws_are_inside_the_limits_and_reach_all_over() -> None:
    basis = choose_basis([recorded().theta])
    theta, counts = draw_sample([recorded().theta], basis, 4000, np.random.default_rng(0))
    assert theta.shape == (4000, 20)
    assert counts == {"recorded": 2000, "walks": 1000, "curls": 1000}
    assert (theta >= LIMITS[:, 0]).all()
    assert (theta <= LIMITS[:, 1]).all()


def test_drawn_joints_and_neighbours_correlate_but_not_fully() -> None:
    theta = draw_curls(20_000, OPEN, FIST, np.random.default_rng(0))
    r = np.corrcoef(theta.T)
    assert 0.5 < r[6, 7] < 0.65  # PIP and DIP of the index
    assert r[10, 14] > r[6, 18] > 0.05  # middle with ring, more than index with little
    spread = np.std(theta[theta[:, 4] < 0.3, 5]), np.std(theta[theta[:, 4] > 1.2, 5])
    assert spread[0] > 2 * spread[1]  # abduction fades as the MCP bends


def test_walks_run_between_basis_states() -> None:
    basis = choose_basis([recorded().theta])
    theta = draw_walks(2000, basis, np.random.default_rng(0))
    c = curls(theta, basis.extended, basis.curled)
    rate = ((c > 0.98) | (c < 0.02)).mean()  # digits that rest, or are at an end
    assert 0.5 < rate < 0.85


def test_thinning_drops_a_hand_held_still() -> None:
    still = np.zeros((50, 20))
    moving = np.zeros((50, 20))
    moving[:, 3] = np.radians(np.arange(50.0))
    assert len(thin(still)) == 1
    assert len(thin(moving, 1.9)) == 25
    assert len(thin(still[:0])) == 0


def test_kept_is_one_for_what_lies_in_the_space_and_none_off_it() -> None:
    space = default()
    rng = np.random.default_rng(0)
    inside = space.to_angles(rng.normal(size=(100, 7)), clip=False)
    share, rms_deg = kept_by(space, inside)
    assert share == pytest.approx(1.0)
    assert rms_deg == pytest.approx(0.0, abs=1e-9)
    off = space.with_dims(20).components[12]
    assert kept_by(space, space.mean + rng.normal(size=(100, 1)) * off)[0] < 0.05


def test_refusals() -> None:
    with pytest.raises(InputError, match="keep 1 basis"):
        fit_space([recorded()], keep=1)
    with pytest.raises(InputError, match="too few"):
        fit_space([recorded()], samples=10)
    with pytest.raises(InputError, match="there are none"):
        fit_space([])
    with pytest.raises(InputError, match="no recordings to fit to"):
        SpaceFit()()


@pytest.mark.ratchet
def test_seven_dimensions_keep_recorded_motion() -> None:
    share, rms_deg = kept_by(default(), shipped_motion().theta)
    assert share > 0.88
    assert rms_deg < 7.5


def test_report_runs_on_what_is_in_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert SpaceReport()() == 0
    out = capsys.readouterr().out
    assert "sample (fitted)" in out
    assert "motion in the package" in out
    assert all(name in out for name, _ in default().dropped)


def test_commands_on_the_real_sets(
    shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = shared / "data"
    out = tmp_path / "space.npz"
    assert SpaceFit(leap=data / "leap", intel=data / "intel", out=out)() == 0
    ours, again = default(), load(out)
    np.testing.assert_allclose(again.covariance, ours.covariance, atol=1e-9)  # what ships
    assert again.provenance == ours.provenance
    assert SpaceReport(space=out, intel=data / "intel")() == 0
    assert "hand_tracking_samples (part of the fit)" in capsys.readouterr().out
