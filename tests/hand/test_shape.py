"""The shape of a hand: its file, and what is refused."""

from dataclasses import fields, replace

import numpy as np
import pytest

from handtrack.errors import InputError, OutputError
from handtrack.hand.shape import HandShape


def test_file_round_trip(tmp_path):
    shape = replace(HandShape.default().scaled(1.07), calibrated=True, source="the hand of Jörg")
    shape.save(tmp_path / "hand.toml")
    back = HandShape.load(tmp_path / "hand.toml")
    for field in fields(HandShape):
        found, wanted = getattr(back, field.name), getattr(shape, field.name)
        if isinstance(wanted, np.ndarray):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-4, err_msg=field.name)
        else:
            assert found == wanted, field.name


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("palm_radius_mm", "palm_radius", "unknown key palm_radius"),
        ("palm_radius_mm = 12.0\n", "", "missing key palm_radius_mm"),
        ("length_mm = [", "len_mm = [", r"unknown key thumb\.len_mm"),
        ("[little]", "[pinky]", "unknown key pinky"),
        ("version = 1", "version = 3", "version 3"),
        ("handtrack-hand", "handtrack-camera", "'handtrack-camera'"),
        ("12.0", "true", "palm_radius_mm = True is no number"),
        ("12.0", '"thick"', "palm_radius_mm = 'thick' is no number"),
        ("12.0", "nan", "palm_radius_mm must be positive"),
        ("12.0", "-12.0", "palm_radius_mm must be positive"),
        ("[thumb]", "thumb = 3\n[other]", "wanted a table"),
        ("version = 1", "version = 1 =", "not a TOML file"),
    ],
)
def test_file_is_checked(old, new, says, tmp_path):
    path = tmp_path / "hand.toml"
    HandShape.default().save(path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=says) as error:
        HandShape.load(path)
    assert "hand.toml" in str(error.value)


def test_files_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        HandShape.load(tmp_path / "none.toml")
    with pytest.raises(OutputError, match="cannot be written"):
        HandShape.default().save(tmp_path / "none" / "hand.toml")


def test_arrays_are_read_only_copies():
    lengths = HandShape.default().length_mm.copy()
    shape = replace(HandShape.default(), length_mm=lengths)
    lengths[0] = 1.0
    assert shape.length_mm[0, 0] != 1.0
    with pytest.raises(ValueError, match="read-only"):
        shape.length_mm[0, 0] = 1.0


@pytest.mark.parametrize("value", [np.ones((5, 2)), np.full((5, 3), np.nan), np.zeros((5, 3))])
def test_lengths_that_make_no_hand(value):
    with pytest.raises(InputError, match="length_mm"):
        replace(HandShape.default(), length_mm=value)


def test_scaling_scales_lengths_and_leaves_directions():
    shape, twice = HandShape.default(), HandShape.default().scaled(2.0)
    assert twice.palm_length_mm == pytest.approx(2 * shape.palm_length_mm)
    assert twice.wrist_radius_mm == 2 * shape.wrist_radius_mm
    np.testing.assert_array_equal(twice.rest_rotvec, shape.rest_rotvec)
