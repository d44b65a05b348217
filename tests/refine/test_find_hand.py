"""The search for a hand in a silhouette with no idea of its pose."""

from unittest.mock import patch

import numpy as np

from handtrack import rotation
from handtrack.estimate import Estimate
from handtrack.records import Pose
from handtrack.refined import RefinedMethod
from handtrack.seeds import SeedSettings, find_hand


def test_finds_a_hand_that_was_elsewhere_and_searches_from_what_was_found(method, view, truth):
    begun: list[Estimate] = []
    ended: list[Estimate] = []

    def watched(self, view, seed, rng):
        begun.append(seed)
        end = search(self, view, seed, rng)
        ended.append(end)
        return end

    pose, std = truth[0], np.full(20, np.radians(30.0))
    turned = Pose(rotation.exp([0.3, -0.3, 0.4]) @ pose.R, pose.t_mm)
    known = Estimate(turned, np.zeros(20), std)
    search = RefinedMethod.search
    settings = SeedSettings()
    with patch.object(RefinedMethod, "search", watched):
        found = find_hand(view, method, ("palm",), np.random.default_rng(0), settings, known)
    assert found is not None
    n = settings.finalists
    assert len(begun) == n * settings.searches
    assert {id(e) for e in begun[n:]} == {id(e) for e in ended[:n]}
    assert any(found[0] is e for e in ended[-n:])
    assert rotation.angle_between(found[0].pose.R, pose.R) < np.radians(20)
    assert found[1] > 0.9
