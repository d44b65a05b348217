import cv2
import numpy as np
import pytest

from handtrack.evidence.edges import find_edges


def step(angle, contrast=40.0, colour=(1.0, 1.0, 1.0), noise=0.0, size=80, supersample=8):
    """A straight step through the middle; its gradient points along ``angle``."""
    s = supersample
    y, x = (np.mgrid[: size * s, : size * s] + 0.5) / s - 0.5
    c = (size - 1) / 2
    side = (x - c) * np.cos(angle) + (y - c) * np.sin(angle) > 0
    picture = 100 + contrast * side[..., None] * np.array(colour)
    picture = cv2.resize(picture.astype(np.float32), (size, size), interpolation=cv2.INTER_AREA)
    return np.clip(
        picture + np.random.default_rng(0).normal(0, noise, picture.shape), 0, 255
    ).astype(np.uint8)


@pytest.mark.parametrize("angle_deg", [0, 17, 45, 80, 90, 133, 171])
def test_points_lie_on_the_edge_between_pixels(angle_deg):
    angle = np.radians(angle_deg)
    edges = find_edges(step(angle))
    n = np.array([np.cos(angle), np.sin(angle)])
    assert len(edges.points) > 60
    off = (edges.points - 39.5) @ n
    assert np.abs(off).mean() < 0.1
    assert np.abs(off).max() < 0.3
    assert np.abs(edges.normals @ n).min() > 0.99
    at = edges.points.round().astype(int)
    along = edges.x[at[:, 1], at[:, 0]] * n[0] + edges.y[at[:, 1], at[:, 0]] * n[1]
    assert np.abs(along).min() > 0.99


def test_sees_edges_in_colour_alone():
    edges = find_edges(step(0.3, colour=(1.0, -0.5, 0.0)))
    assert len(edges.points) > 60


def test_a_weak_edge_inside_the_hand_registers_beside_a_strong_outline():
    picture = np.full((120, 120, 3), 90.0)
    picture[20:100, 20:100] = (210, 160, 140)
    picture[45:75, 45:80] -= 7  # a folded finger: a little darker
    soft = cv2.GaussianBlur(picture, (0, 0), 0.8)
    rng = np.random.default_rng(1)
    edges = find_edges(np.clip(soft + rng.normal(0, 1.0, picture.shape), 0, 255).astype(np.uint8))
    x, y = edges.points.T
    left = (np.abs(x - 44.5) < 1) & (y > 48) & (y < 72)
    assert left.sum() > 15
    assert edges.point_strength[left].mean() > 0.6
    flat = (x > 84) & (x < 96) & (y > 25) & (y < 95)
    assert flat.sum() < 10


@pytest.mark.parametrize("noise", [0.0, 1.5, 4.0])
def test_noise_alone_has_hardly_any_edges(noise):
    edges = find_edges(step(0.0, contrast=0.0, noise=noise, size=200))
    assert len(edges.points) < 0.01 * 200 * 200


def test_flat_and_tiny_pictures():
    assert len(find_edges(np.full((50, 50, 3), 7, np.uint8)).points) == 0
    assert find_edges(np.zeros((4, 4, 3), np.uint8)).strength.shape == (4, 4)
