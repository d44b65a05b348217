import cv2
import numpy as np
import pytest

from handtrack.evidence.contour import clean, signed_distance, trace


def field(sdf, sharpness=3.0):
    """Log odds of an exact signed distance."""
    return np.clip(-sharpness * sdf, -6, 6).astype(np.float32)


def disc(x, y, r, shape=(90, 110)):
    yy, xx = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(xx - x, yy - y) - r


@pytest.mark.parametrize(
    ("x", "y", "r"), [(40.3, 45.7, 25.4), (60.0, 40.5, 8.2), (50.5, 44.1, 5.0)]
)
def test_outline_lies_between_pixels(x, y, r):
    L = field(disc(x, y, r))
    outline = trace(L > 0, L, np.zeros_like(L))
    d = outline.points - (x, y)
    assert np.abs(np.hypot(*d.T) - r).max() < 0.25
    assert np.einsum("ij,ij->i", d, outline.normals).min() > 0.85 * r
    np.testing.assert_allclose(np.hypot(*outline.normals.T), 1, atol=1e-5)


def test_moves_to_an_edge_of_the_picture_outside_and_hardly_to_one_inside():
    sdf = disc(50, 45, 25)
    for offset, moved in ((0.5, 0.4), (1.0, 0.8), (-0.5, -0.1), (-1.0, -0.2), (3.0, 0.0)):
        gradient = (20 * np.exp(-0.5 * (sdf - offset) ** 2)).astype(np.float32)
        outline = trace(sdf < 0, field(sdf), gradient)
        r = np.hypot(*(outline.points - (50, 45)).T) - 25
        assert np.median(r) == pytest.approx(moved, abs=0.1)
        assert (outline.snapped.mean() > 0.95) == (offset < 2)
    assert not trace(sdf < 0, field(sdf), np.zeros_like(field(sdf))).snapped.any()


def test_hole_has_normals_into_the_hole():
    sdf = np.maximum(disc(50, 45, 30), -disc(50, 45, 15))
    outline = trace(sdf < 0, field(sdf), np.zeros_like(field(sdf)))
    d = outline.points - (50, 45)
    r = np.hypot(*d.T)
    outward = np.einsum("ij,ij->i", d, outline.normals)
    assert (outward[r > 25] > 0).all()
    assert (outward[r < 20] < 0).all()
    assert len(np.unique(outline.chain)) == 2


def test_signed_distance_is_exact_near_the_outline():
    sdf = disc(40.2, 45.7, 20)
    other = disc(82.4, 45.1, 12)
    both = np.minimum(sdf, other)
    outline = trace(both < 0, field(both), np.zeros_like(field(both)))
    found = signed_distance(both < 0, outline)
    assert np.abs(found - both)[np.abs(both) < 6].mean() < 0.1
    assert np.abs(found - both)[np.abs(both) < 6].max() < 0.35
    assert np.abs(found - both).max() < 2


def test_signed_distance_of_nothing_is_far():
    nothing = np.zeros((20, 30), bool)
    L = np.full((20, 30), -6, np.float32)
    assert (signed_distance(nothing, trace(nothing, L, L)) == 50).all()


def test_fingers_three_pixels_apart_stay_apart_and_thin_ones_stay():
    mask = np.zeros((90, 110), bool)
    mask[50:80, 20:60] = True
    for x in (20, 31, 42):
        mask[10:50, x : x + 8] = True  # gaps of 3 px
    mask[20:52, 55:57] = True  # 2 px wide
    L = field(np.where(mask, -2.0, 2.0))
    kept = clean(L > 0, None)
    assert (kept == mask).all()
    outline = trace(kept, L, np.zeros_like(L))
    in_gap = (np.abs(outline.points[:, 0] - 29) < 2) & (outline.points[:, 1] < 45)
    normals = outline.normals[in_gap, 0]
    assert (normals > 0.9).sum() > 20
    assert (normals < -0.9).sum() > 20


def test_clean_chooses_by_the_seed_and_drops_specks():
    mask = (disc(30, 45, 15) < 0) | (disc(80, 45, 20) < 0)
    mask[5, 5] = True
    mask[45, 28:31] = False  # a pinhole
    assert (clean(mask, None) == (disc(80, 45, 20) < 0)).all()
    assert (clean(mask, disc(32, 44, 15) < 0) == (disc(30, 45, 15) < 0)).all()
    both = clean(mask, (disc(30, 45, 16) < 0) | (disc(80, 45, 21) < 0))
    assert (both == ((disc(30, 45, 15) < 0) | (disc(80, 45, 20) < 0))).all()
    assert not clean(mask, disc(55, 10, 4) < 0).any()
    assert not clean(np.zeros((9, 9), bool), None).any()


def test_a_large_hole_is_kept():
    ring = (disc(50, 45, 30) < 0) & (disc(50, 45, 10) > 0)
    assert (clean(ring, None) == ring).all()
    assert cv2.connectedComponents((~clean(ring, None)).astype(np.uint8))[0] == 3
