"""The configuration space: axioms of its projection, lines against the plain formulas, its file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.decomposition import PCA

from handtrack.errors import InputError, OutputError
from handtrack.hand.skeleton import LIMITS
from handtrack.hand.space import (
    ALL_PATTERNS,
    ConfigurationSpace,
    default,
    load,
    principal,
    state_name,
)

SPACE = default()


def cloud(n: int, seed: int = 0) -> np.ndarray:
    """Configurations ``(n, 7)`` spread as the sample is."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, SPACE.n_dims)) * np.sqrt(SPACE.variance)


def test_projection_is_orthogonal_and_idempotent() -> None:
    np.testing.assert_allclose(SPACE.components @ SPACE.components.T, np.eye(7), atol=1e-12)
    X = cloud(200)
    np.testing.assert_allclose(SPACE.to_X(SPACE.to_angles(X, clip=False)), X, atol=1e-12)
    theta = np.random.default_rng(1).uniform(LIMITS[:, 0], LIMITS[:, 1], (200, 20))
    lost = theta - SPACE.to_angles(SPACE.to_X(theta), clip=False)
    np.testing.assert_allclose(lost @ SPACE.components.T, 0, atol=1e-12)


def test_angles_are_kept_inside_the_limits() -> None:
    theta = SPACE.to_angles(5 * cloud(200))
    assert (theta >= LIMITS[:, 0]).all()
    assert (theta <= LIMITS[:, 1]).all()
    assert (SPACE.to_angles(5 * cloud(200), clip=False) > LIMITS[:, 1]).any()


def test_principal_directions_against_scikit_learn() -> None:
    rng = np.random.default_rng(2)
    sample = rng.normal(size=(500, 20)) @ rng.normal(size=(20, 20))
    reference = PCA().fit(sample)
    variances, rows = principal(np.cov(sample.T))
    np.testing.assert_allclose(variances, reference.explained_variance_, rtol=1e-9)
    np.testing.assert_allclose(np.abs((rows * reference.components_).sum(1)), 1, atol=1e-9)
    assert (rows[np.arange(20), np.abs(rows).argmax(1)] > 0).all()


def test_nearest_line_against_the_plain_formulas() -> None:
    X = cloud(300)
    B, (i, j) = SPACE.basis_X, SPACE.lines.T
    along = B[j] - B[i]
    s = ((X[:, None] - B[i]) * along).sum(-1) / (along**2).sum(-1)  # (4), squared norm
    s = np.clip(s, 0, 1)
    feet = B[i] + s[..., None] * along  # (5)
    distance = np.linalg.norm(X[:, None] - feet, axis=-1)
    found = SPACE.nearest_line(X)
    np.testing.assert_allclose(found.distance, distance.min(axis=1), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(X - found.foot, axis=1), found.distance, atol=1e-12)
    inside = (found.s > 1e-9) & (found.s < 1 - 1e-9)  # at the ends several lines are as near
    assert inside.sum() > 50
    best = distance.argmin(axis=1)[inside]
    np.testing.assert_array_equal(found.pair[inside], SPACE.lines[best])
    np.testing.assert_allclose(found.s[inside], s[inside, best], atol=1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-7])
def test_points_on_a_line_find_it(off: float) -> None:
    rng = np.random.default_rng(3)
    i, j = SPACE.lines.T
    s = rng.uniform(0.3, 0.7, len(i))[:, None]
    X = (1 - s) * SPACE.basis_X[i] + s * SPACE.basis_X[j]
    found = SPACE.nearest_line(X + off)
    assert found.distance.max() < 1e-6
    # lines of opposite patterns cross; what is found must then be as near
    same = (found.pair == SPACE.lines).all(axis=1)
    assert same.mean() > 0.8


def test_basis_states_are_the_patterns_that_are_kept() -> None:
    assert (len(SPACE.basis_curled), len(SPACE.lines)) == (28, 378)
    names = {state_name(p) for p in ALL_PATTERNS}
    dropped = {name for name, _ in SPACE.dropped}
    assert dropped == {"--M-L", "-IM-L", "T-M-L", "TIM-L"}
    assert names == dropped | set(SPACE.basis_names)
    assert SPACE.support.sum() == pytest.approx(1.0)
    assert max(support for _, support in SPACE.dropped) <= np.sort(SPACE.support)[3]
    # what the space makes of its basis states is still those states
    off = np.degrees(SPACE.to_angles(SPACE.basis_X) - SPACE.basis_theta)
    assert np.sqrt((off**2).mean()) < 4


def test_how_many_basis_states_are_kept_is_a_setting() -> None:
    all_of_them = SPACE.with_basis(32)
    assert (len(all_of_them.lines), all_of_them.dropped) == (496, ())
    assert SPACE.with_basis(28).basis_names == SPACE.basis_names
    fewer = SPACE.with_basis(20)
    assert set(fewer.basis_names) < set(SPACE.basis_names)
    assert fewer.basis_X.shape == (20, 7)
    with pytest.raises(InputError, match="keep 33"):
        SPACE.with_basis(33)


def test_prior_covariance_is_wider_than_the_sample() -> None:
    prior = SPACE.prior_covariance()
    assert np.linalg.eigvalsh(prior - SPACE.covariance).min() > np.radians(5.9) ** 2
    np.testing.assert_allclose(
        prior, 2.25 * SPACE.covariance + np.radians(6) ** 2 * np.eye(20), atol=1e-15
    )


def test_other_dimensions_are_nested() -> None:
    nine = SPACE.with_dims(9)
    np.testing.assert_allclose(nine.components[:7], SPACE.components, atol=1e-9)
    for k in (0, 21):
        with pytest.raises(InputError, match="1 to 20 dimensions"):
            SPACE.with_dims(k)


def test_file_round_trip_and_refusals(tmp_path: Path) -> None:
    SPACE.save(tmp_path / "a.npz")
    again = load(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.covariance, SPACE.covariance)
    assert (again.provenance, again.basis_names) == (SPACE.provenance, SPACE.basis_names)
    (tmp_path / "b.npz").write_bytes(b"not a file of arrays")
    np.savez(tmp_path / "c.npz", mean=np.zeros(20))
    (tmp_path / "e.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:500])
    np.save(tmp_path / "d.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    for name in ("b.npz", "c.npz", "d.npy", "e.npz", "absent.npz"):
        with pytest.raises(InputError) as caught:
            load(tmp_path / name)
        assert name in str(caught.value)
    with pytest.raises(OutputError):
        SPACE.save(tmp_path / "no folder" / "x.npz")


def test_record_is_read_only_and_checked() -> None:
    with pytest.raises(ValueError, match="read-only"):
        SPACE.mean[0] = 0
    with pytest.raises(InputError, match="mean is not"):
        replace(SPACE, mean=np.zeros(19))
    assert isinstance(SPACE, ConfigurationSpace)


def test_what_ships_says_where_it_is_from() -> None:
    licences = {source["licence"] for source in SPACE.provenance["sources"]}
    assert licences == {"Apache-2.0"}
    assert sum(SPACE.provenance["sample"].values()) >= 30_000
