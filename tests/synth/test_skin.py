"""The skinned hand: closed, thick where it bends, and where its bones are."""

import numpy as np
import pytest

from synth.handspec import HAND_NAMES, HandSpec
from synth.kinematics import bone_frames
from synth.light import openness, visibility
from synth.scene import Light
from synth.skin import Skin
from synth.surface import REST_THETA, field_at, flesh, rest_mesh


@pytest.fixture(scope="module")
def skin() -> Skin:
    hand = HandSpec.named("average")
    return Skin(rest_mesh(hand, 30.0), hand)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", HAND_NAMES)
def test_the_mesh_is_closed_and_one_piece(name: str) -> None:
    mesh = rest_mesh(HandSpec.named(name), 30.0)
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()
    n, m = len(mesh.vertices), len(mesh.faces)
    assert n - m * 3 // 2 + m == 2  # Euler: a sphere, so no finger is fused to its neighbour
    assert 150e3 < volume(mesh.vertices, mesh.faces) < 700e3  # mm^3, outward facing


def test_vertices_lie_on_the_blended_field() -> None:
    hand = HandSpec.named("average")
    cones, part, blend = flesh(hand, 30.0)
    some = rest_mesh(hand, 30.0).vertices[::200]
    off = [field_at(p, cones, part, blend) for p in some]
    assert np.abs(off).max() < 0.25


def test_weights_sum_to_one_and_rest_is_rest(skin: Skin) -> None:
    assert skin.weights.min() >= 0
    assert skin.weights.sum(axis=1) == pytest.approx(np.ones(len(skin.weights)))
    assert skin.pose(REST_THETA) == pytest.approx(skin.mesh.vertices, abs=1e-9)


@pytest.mark.parametrize("flexion_deg", [0.0, 45.0, 90.0])
def test_bent_fingers_keep_their_thickness(skin: Skin, flexion_deg: float) -> None:
    theta = np.zeros(20)
    theta[[8, 10, 11]] = np.radians([flexion_deg, flexion_deg, 0.6 * flexion_deg])
    vertices = skin.pose(theta)
    _, start, end = bone_frames(theta, skin.hand)
    for bone in (6, 7):  # middle finger
        a, b = start[bone], end[bone]
        half_way = skin.hand.length_mm[2, : bone - 6].sum() + skin.hand.length_mm[2, bone - 6] / 2
        s = (vertices - a) @ (b - a) / ((b - a) @ (b - a))
        at = (skin.chart.share[:, 3] > 0.9) & (np.abs(skin.chart.local[:, 2, 1] - half_way) < 2)
        reach = np.linalg.norm(vertices[at] - a - s[at, None] * (b - a), axis=1)
        thick = skin.hand.radius_mm[2, bone - 6 : bone - 4].mean()
        assert reach.max() < 1.45 * thick
        assert reach.min() > 0.8 * thick


def test_a_fist_keeps_its_volume(skin: Skin) -> None:
    fist = np.radians(np.array([[35, 10, 45, 45], *[[85, 0, 100, 60]] * 4], float).ravel())
    open_hand = volume(skin.pose(np.zeros(20)), skin.mesh.faces)
    assert volume(skin.pose(fist), skin.mesh.faces) == pytest.approx(open_hand, rel=0.12)


def test_tips_of_the_skin_are_the_tips_of_the_bones(skin: Skin) -> None:
    theta = np.zeros(20)
    theta[[4, 6, 7]] = np.radians([30, 50, 30])
    _, _, end = bone_frames(theta, skin.hand)
    vertices = skin.pose(theta)
    for bone in (2, 5, 8, 11, 14):
        nearest = np.linalg.norm(vertices - end[bone], axis=1).min()
        assert nearest < 2.0


@pytest.mark.parametrize("name", HAND_NAMES)
def test_joints_are_as_thick_as_the_hand_says(name: str) -> None:
    hand = HandSpec.named(name)
    skin = Skin(rest_mesh(hand, 30.0), hand)
    for d in range(1, 5):
        x, y, _ = skin.chart.local[:, d].T
        on = skin.chart.share[:, d + 1] > 0.6
        for j, at in enumerate(np.cumsum(hand.length_mm[d])[:2]):
            half = np.ptp(x[on & (np.abs(y - at) < 1.2)]) / 2
            assert half == pytest.approx(hand.radius_mm[d, j + 1], abs=0.4)
        assert y[on].max() == pytest.approx(hand.length_mm[d].sum(), abs=0.3)


def test_normals_point_out(skin: Skin) -> None:
    n = skin.normals(skin.mesh.vertices)
    grown = volume(skin.mesh.vertices + 0.5 * n, skin.mesh.faces)
    assert grown > volume(skin.mesh.vertices, skin.mesh.faces)


def test_the_forearm_turns_alone(skin: Skin) -> None:
    moved = skin.pose(REST_THETA, (0.0, 0.3)) - skin.mesh.vertices
    size = np.linalg.norm(moved, axis=1)
    far = skin.mesh.vertices[:, 1] > 12
    assert size[far].max() < 1e-9
    assert size.max() > 5


def test_clefts_get_less_light_than_open_skin(skin: Skin) -> None:
    facing = np.diag([1.0, -1.0, -1.0])
    fist = np.radians(np.array([[10, 0, 10, 10], *[[80, 0, 95, 55]] * 4], float).ravel())

    def open_share(theta: np.ndarray) -> np.ndarray:
        v = skin.pose(theta)
        return openness(v @ facing, skin.normals(v) @ facing, skin.mesh.faces)

    flat, closed = open_share(np.zeros(20)), open_share(fist)
    palm = (skin.chart.share[:, 0] > 0.99) & (np.abs(skin.mesh.vertices[:, 1] - 55) < 12)
    palm &= skin.normals(skin.mesh.vertices)[:, 2] > 0.8
    assert flat[palm].mean() > 0.85
    assert closed[palm].mean() < 0.75
    assert flat.max() <= 1.0 + 1e-9


def test_a_finger_throws_a_shadow(skin: Skin) -> None:
    facing = np.diag([1.0, -1.0, -1.0])
    bent = np.zeros(20)
    bent[[4, 8, 12, 16]] = np.radians(80)
    lamp = Light(from_mm=(0.0, -400.0, -500.0), at_mm=(0.0, 0.0, 0.0))
    palm = (skin.chart.share[:, 0] > 0.99) & (np.abs(skin.mesh.vertices[:, 1] - 65) < 8)
    palm &= skin.normals(skin.mesh.vertices)[:, 2] > 0.8
    lit = visibility(skin.pose(np.zeros(20)) @ facing, skin.mesh.faces, lamp)[palm]
    dark = visibility(skin.pose(bent) @ facing, skin.mesh.faces, lamp)[palm]
    assert lit.mean() > 0.95
    assert dark.mean() < 0.4
