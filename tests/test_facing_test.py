"""The sequential test of which side of a hand is shown."""

import pytest

from handtrack.facing_test import FacingSettings, FacingTest

SETTINGS = FacingSettings(right=0.5, wrong=1.5, most=2.0, share=0.5, sure=3.0)


def watched(log_odds):
    test, asked = FacingTest(SETTINGS), 0
    for one in log_odds:
        if test.is_over:
            break
        test.watch(one)
        asked += 1
    return test, asked


def test_what_speaks_clearly_settles_it():
    right, looks = watched([9.0] * 5)
    assert (right.is_wrong, right.is_over, looks) == (False, True, 3)
    wrong, looks = watched([-9.0] * 5)
    assert (wrong.is_wrong, wrong.is_over, looks) == (True, True, 3)


def test_no_frame_settles_it_alone():
    assert not watched([-1000.0])[0].is_over


def test_an_open_palm_that_looks_a_little_like_a_back_stays_a_palm_for_ever():
    test, _ = watched([-1.2] * 500)
    assert (test.lead, test.is_over) == (0.0, False)
    assert watched([-1.2] * 500 + [3.5] * 4)[0].lead == pytest.approx(3.0)
