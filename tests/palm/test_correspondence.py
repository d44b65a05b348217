"""Matches are one to one, gated, of compatible normals, and the same as the greedy ones."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.palm.correspondence import EdgePoints, correspond


def unit(rng, n):
    angle = rng.uniform(-np.pi, np.pi, n)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def greedy(q, normals, edges, gate, angle, signed):
    """All compatible pairs, nearest first, each point once."""
    distance = np.linalg.norm(q[:, None] - edges.points_px, axis=2)
    cosine = normals @ edges.normals.T
    cosine = cosine if signed else np.abs(cosine)
    rows, columns = np.nonzero((distance < gate) & (cosine >= np.cos(angle)))
    order = np.argsort(distance[rows, columns])
    found, used = {}, set()
    for i, j in zip(rows[order], columns[order], strict=True):
        if i not in found and j not in used:
            found[i] = j
            used.add(j)
    return sorted(found.items())


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("gate", [5.0, 30.0, 300.0])
def test_same_as_greedy(signed, gate):
    rng = np.random.default_rng(0)
    for n, m in ((40, 200), (60, 20), (1, 1), (30, 30)):
        q, edges = (
            rng.uniform(0, 100, (n, 2)),
            EdgePoints(rng.uniform(0, 100, (m, 2)), unit(rng, m)),
        )
        normals = unit(rng, n)
        matches = correspond(q, normals, edges, gate, 0.8, signed)
        pairs = list(zip(matches.model, matches.edge, strict=True))
        assert pairs == greedy(q, normals, edges, gate, 0.8, signed)
        assert len(set(matches.edge)) == len(matches.edge)


def test_a_drifted_outline_does_not_share_one_edge_point():
    up = np.tile([0.0, 1.0], (5, 1))
    outline = np.column_stack([np.linspace(0, 1, 5), np.zeros(5)])
    edges = EdgePoints(np.column_stack([np.arange(5.0), np.zeros(5)]), up)
    matches = correspond(outline, up, edges, gate_px=10.0)
    assert sorted(matches.edge) == [0, 1, 2, 3, 4]


def test_reversed_normals_match_only_when_signs_are_unknown():
    edges = EdgePoints(np.zeros((1, 2)), np.array([[0.0, -1.0]]))
    up = np.array([[0.0, 1.0]])
    assert len(correspond(np.zeros((1, 2)), up, edges, 1.0, signed=False).model) == 1
    assert len(correspond(np.zeros((1, 2)), up, edges, 1.0, signed=True).model) == 0


def test_what_is_not_finite_is_left_out():
    edges = EdgePoints([[np.nan, 0], [1, 0], [0, 0]], [[1, 0], [np.nan, 0], [1, 0]])
    assert edges.original.tolist() == [2]
    outline = np.array([[np.nan, 0.0], [0.1, 0.0]])
    matches = correspond(outline, np.tile([1.0, 0.0], (2, 1)), edges, 1.0)
    assert matches.model.tolist() == [1]
    empty = EdgePoints(np.empty((0, 2)), np.empty((0, 2)))
    assert len(correspond(outline, outline, empty, 1.0).model) == 0


def test_bad_shapes_are_refused():
    with pytest.raises(InputError, match="edge points"):
        EdgePoints(np.zeros((3, 2)), np.zeros((2, 2)))
