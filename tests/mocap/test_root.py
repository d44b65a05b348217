"""The root link: exact on exact data, bridged where it must be, refused where it cannot be."""

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.mocap.markers import Gap, Markers
from handtrack.mocap.root import find_root, kabsch, reference_of, root_relative

EXACT = 1e-10
TRIANGLE = np.array([[0.0, 0, 0], [40, 0, 5], [0, 60, 0]])


@pytest.fixture
def motion() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rotation.exp(rng.normal(size=(30, 3))), rng.normal(0, 500, (30, 3))


def moved(points, R, t):
    return np.einsum("fab,nb->fna", R, points) + t[:, None]


@pytest.mark.parametrize("n", [3, 4, 7])
def test_a_rigid_transform_is_recovered_exactly(motion, n):
    R, t = motion
    p = np.random.default_rng(1).normal(0, 50, (n, 3))
    got_R, got_t = kabsch(p, moved(p, R, t))
    np.testing.assert_allclose(got_R, R, atol=EXACT)
    np.testing.assert_allclose(got_t, t, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(got_R), 1, atol=EXACT)


def test_going_to_the_root_and_back(motion):
    R, t = motion
    link = find_root(moved(TRIANGLE, R, t), TRIANGLE)
    X = np.random.default_rng(2).normal(0, 100, (30, 5, 3))
    np.testing.assert_allclose(link.to_world(link.to_root(X)), X, atol=1e-9)
    still = np.tile(TRIANGLE, (30, 1, 1))
    np.testing.assert_allclose(link.to_root(moved(TRIANGLE, R, t)), still, atol=1e-9)
    assert link.residual_mm.max() < 1e-9


def test_gaps_are_bridged_along_the_motion_and_reported():
    angle = np.linspace(0, 1, 21)
    R, t = rotation.about_z(angle), np.linspace(0, 100, 21)[:, None] * np.ones(3)
    q = moved(TRIANGLE, R, t)
    q[5:8, 1] = np.nan
    q[20, 0] = np.nan
    link = find_root(q, TRIANGLE)
    assert link.bridged == (Gap("root", 5, 7), Gap("root", 20, 20))
    np.testing.assert_allclose(link.R[5:8], R[5:8], atol=1e-9)
    np.testing.assert_allclose(link.t_mm[5:8], t[5:8], atol=1e-6)
    np.testing.assert_allclose(link.R[20], R[19], atol=EXACT)
    assert np.isnan(link.residual_mm[[5, 20]]).all()


def test_a_fourth_marker_takes_over_where_one_is_missing(motion):
    R, t = motion
    p = np.vstack([TRIANGLE, [30, 30, 20]])
    q = moved(p, R, t)
    q[::2, 0] = np.nan
    link = find_root(q, p)
    np.testing.assert_allclose(link.R, R, atol=EXACT)
    assert link.bridged == ()


def test_the_own_frame_of_the_root_does_not_depend_on_where_it_moved(motion):
    R, t = motion
    still = reference_of(np.tile(TRIANGLE, (4, 1, 1)))
    np.testing.assert_allclose(reference_of(moved(TRIANGLE, R, t)), still, atol=1e-8)
    np.testing.assert_allclose(still.mean(axis=0), 0, atol=EXACT)
    np.testing.assert_allclose(still[0, 1:], 0, atol=EXACT)


def test_markers_in_the_root_frame(motion):
    R, t = motion
    finger = np.array([[10.0, 150, -5]])
    positions = moved(np.vstack([TRIANGLE, finger]), R, t)
    markers = Markers(("a", "b", "c", "tip"), positions, 100.0)
    got = root_relative(markers, ("a", "b", "c"), TRIANGLE)
    assert got.labels == ("tip",)
    np.testing.assert_allclose(got.positions_mm, np.tile(finger, (30, 1, 1)), atol=1e-9)


def test_what_cannot_be_a_root():
    line = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])
    with pytest.raises(InputError, match="2 root markers"):
        find_root(np.zeros((4, 2, 3)), np.zeros((2, 3)))
    with pytest.raises(InputError, match="on one line"):
        find_root(np.tile(line, (2, 1, 1)), line)
    with pytest.raises(InputError, match="on one line"):
        reference_of(np.tile(line, (2, 1, 1)))
    with pytest.raises(InputError, match="no frame shows 3"):
        find_root(np.full((2, 3, 3), np.nan), TRIANGLE)
    with pytest.raises(InputError, match="no frame shows all"):
        reference_of(np.full((2, 3, 3), np.nan))
