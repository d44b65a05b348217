"""The page of conventions says what the code does, and its drawing is made from the code."""

import doctest
from pathlib import Path

import numpy as np
import pytest

from handtrack import ANGLE_NAMES, KEYPOINT_NAMES
from handtrack.errors import OutputError
from handtrack.hand.skeleton import DIGITS
from handtrack.output.conventions import hand_at, path_of, write

PAGE = Path(__file__).resolve().parents[2] / "docs" / "conventions.md"


def test_examples_on_the_page_run():
    result = doctest.testfile(str(PAGE), module_relative=False)
    assert result.attempted >= 7
    assert result.failed == 0


@pytest.mark.parametrize("angle", ANGLE_NAMES)
def test_senses_on_the_page(angle):
    path = path_of(angle, 20.0)
    moved = path[-1] - path[0]
    assert np.linalg.norm(moved) > 5
    digit, _, kind = angle.partition("_")
    if kind.endswith("abduction"):
        axis = 2 if digit == "thumb" else 0  # out of the palm, to the thumb's side
        assert moved[axis] > 0.9 * np.linalg.norm(moved)
    elif digit == "thumb":
        assert moved[0] < -0.6 * np.linalg.norm(moved)  # across the palm
    else:
        assert moved[2] > 0.9 * np.linalg.norm(moved)  # to the palm


def test_zero_is_flat_and_the_palm_frame_as_stated():
    points = dict(zip(KEYPOINT_NAMES, hand_at(), strict=True))
    np.testing.assert_allclose(points["wrist"], 0)
    np.testing.assert_allclose(points["middle_mcp"][[0, 2]], 0, atol=1e-9)
    assert points["middle_mcp"][1] > 0
    assert points["thumb_tip"][0] > 0  # the thumb is on x's side of a right hand
    for digit in DIGITS[1:]:
        assert abs(points[f"{digit}_tip"][2] - points[f"{digit}_mcp"][2]) < 1e-9


def test_drawing_is_the_same_each_time(tmp_path):
    for name in ("a.png", "b.png"):
        write(tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]
    with pytest.raises(OutputError, match="cannot be written"):
        write(tmp_path / "none" / "a.png")
