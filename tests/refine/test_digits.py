"""The line of a digit runs between what is usual and what is extreme."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack.hand.basis import curls
from handtrack.hand.space import default
from handtrack.mocap.recordings import shipped_motion
from handtrack.refine.digits import digit_lines, off_line_precision


@pytest.fixture(scope="module")
def space():
    return default()


def test_ends_lie_half_way_from_the_extremes_to_recorded_digits(space):
    lines = digit_lines(space)
    assert lines.shape == (5, 2, 4)
    recorded = shipped_motion().theta
    curl = curls(recorded, space.extended, space.curled)
    index = np.median(recorded[curl[:, 1] < 0.2, 4:8], axis=0)
    np.testing.assert_allclose(lines[1, 0], 0.5 * (index + space.extended[4:8]))


def test_recorded_digits_are_nearer_than_to_the_line_of_the_extremes(space):
    digits = shipped_motion().theta.reshape(-1, 5, 4)
    extreme = np.stack([space.extended, space.curled]).reshape(2, 5, 4).transpose(1, 0, 2)

    def apart(lines):
        u = lines[:, 1] - lines[:, 0]
        s = np.clip(((digits - lines[:, 0]) * u).sum(-1) / (u * u).sum(-1), 0, 1)
        return np.abs(digits - lines[:, 0] - s[..., None] * u).mean()

    assert apart(digit_lines(space)) < 0.95 * apart(extreme)


def test_a_space_that_no_recorded_digit_comes_near_keeps_its_own_ends(space):
    far = replace(space, extended=space.extended + 1.5, curled=space.curled + 9.0)
    np.testing.assert_array_equal(digit_lines(far)[:, 1], far.curled.reshape(5, 4))


def test_a_digit_is_free_along_its_line_up_to_the_floor(space):
    lines = digit_lines(space)
    P = off_line_precision(space, lines, widen=1.0, floor_deg=6.0)
    u = lines[:, 1] - lines[:, 0]
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    along = np.einsum("da,dab,db->d", u, P, u)
    np.testing.assert_allclose(along, 1 / np.radians(6.0) ** 2, rtol=1e-9)
    assert (np.linalg.eigvalsh(P) > 0).all()
