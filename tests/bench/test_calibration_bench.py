"""Calibration on rendered open palms of known shape, through the path of the command."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.calibration import TAKES, errors_of, hand_length_mm, measured
from handtrack.cli import main
from handtrack.hand.shape import HandShape
from synth.export import as_hand_shape
from synth.handspec import HandSpec


def at_true_length(truth):
    default = HandShape.default()
    return default.scaled(hand_length_mm(truth) / hand_length_mm(default))


@pytest.mark.parametrize("hand", ["average", "broad", "slender"])
def test_bones_within_six_percent(gl, hand):
    truth = as_hand_shape(HandSpec.named(hand))
    found = measured(hand, ["plain"])["plain"]
    assert found is not None
    assert hand_length_mm(found) == pytest.approx(hand_length_mm(truth))
    errors = errors_of(found, truth)
    assert np.abs(errors.bones_percent).max() < 6.0
    assert np.abs(errors.digits_percent).max() < 4.5
    assert errors.along_deg[1:].mean() < 2.0


def test_an_odd_hand_comes_nearer_than_the_default(gl):
    """A palm so long that the priors hold it back is still measured, not assumed."""
    truth = as_hand_shape(HandSpec.named("long_palm"))
    found = measured("long_palm", ["plain"])["plain"]
    assert found is not None
    ours, usual = errors_of(found, truth), errors_of(at_true_length(truth), truth)
    assert np.abs(ours.digits_percent).max() < 6.0
    assert np.abs(ours.bones_percent).mean() < 0.6 * np.abs(usual.bones_percent).mean()
    assert ours.base_mm[1:].mean() < 0.75 * usual.base_mm[1:].mean()


def test_errors_are_seen():
    """A longer bone, a turned axis and a moved joint each show up, and only where they are."""
    hand = HandShape.default()
    length, base = hand.length_mm.copy(), hand.base_mm.copy()
    length[1, 2] *= 1.1
    base[3] += (3.0, 4.0, 0.0)
    turned = rotation.exp(hand.rest_rotvec)
    turned[4] = turned[4] @ rotation.about_y(np.radians(7.0))
    other = replace(hand, length_mm=length, base_mm=base, rest_rotvec=rotation.log(turned))
    errors = errors_of(other, hand)
    expected = np.zeros((5, 3))
    expected[1, 2] = 10.0
    np.testing.assert_allclose(errors.bones_percent, expected, atol=1e-9)
    np.testing.assert_allclose(errors.base_mm, [0, 0, 0, 5, 0], atol=1e-9)
    np.testing.assert_allclose(errors.flexion_deg, [0, 0, 0, 0, 7], atol=1e-4)
    np.testing.assert_allclose(errors.along_deg, 0, atol=1e-4)


def test_the_command(gl, capsys):
    assert main(["bench", "calibration", "--hands", "small", "--takes", "plain"]) == 0
    said = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in said[1:]]
    assert [row[:2] for row in rows] == [["small", "calibrated"], ["small", "default"]]
    assert rows[0][2] == "1/1"


def test_an_unknown_take_is_named(capsys):
    assert main(["bench", "calibration", "--takes", "upside-down"]) == 2
    assert next(iter(TAKES)) in capsys.readouterr().err
