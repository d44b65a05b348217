"""The likelihood: raster against OpenCV, silhouettes, edges, and who hides whom."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from handtrack.fingers.likelihood import FingerLikelihood, LikelihoodSettings, edge_term
from handtrack.fingers.raster import GRID, WORDS, fill_capsule, fill_convex, pack_bits, popcount
from handtrack.fingers.silhouette import SilhouetteBits, capsule_overlap
from handtrack.hand.shape import HandShape
from handtrack.hand.surface import Capsules, Cardboard
from handtrack.records import Pose
from handtrack.refine.view import View

K = np.array([400.0, 400.0, 119.5, 119.5])
SIDE = 240
POSE = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 75.0, 420.0]))


def unpack(rows: np.ndarray) -> np.ndarray:
    bits = rows.astype("<u8").view(np.uint8).reshape(GRID, WORDS * 8)
    return np.unpackbits(bits, axis=1, bitorder="little").astype(bool)


def test_bits_go_in_and_come_out() -> None:
    mask = np.random.default_rng(0).random((GRID, GRID)) < 0.3
    rows = pack_bits(mask)
    np.testing.assert_array_equal(unpack(rows), mask)
    assert sum(int(popcount(word)) for word in rows.ravel()) == mask.sum()


def test_polygons_are_filled_as_opencv_fills_them() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        hull = cv2.convexHull(rng.uniform(-20, 150, (6, 2)).astype(np.float32))[:, 0]
        rows = np.zeros((GRID, WORDS), np.uint64)
        fill_convex(rows, hull.astype(float), 1.0)
        yy, xx = np.mgrid[:GRID, :GRID]
        inside = np.array(
            [
                cv2.pointPolygonTest(hull, (float(x), float(y)), True)
                for x, y in zip(xx.ravel(), yy.ravel(), strict=True)
            ]
        ).reshape(GRID, GRID)
        differ = unpack(rows) != (inside > 0)
        assert not (differ & (np.abs(inside) > 0.01)).any()


def test_capsules_are_filled_as_two_discs_and_their_tangents() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b = (np.array([*rng.uniform(20, 110, 2), rng.uniform(3, 18)]) for _ in range(2))
        rows = np.zeros((GRID, WORDS), np.uint64)
        fill_capsule(rows, a, b, 1.0)
        yy, xx = np.mgrid[:GRID, :GRID]
        t = np.linspace(0, 1, 400)
        discs = a + (b - a) * t[:, None]
        d = np.min(
            np.hypot(xx[..., None] - discs[:, 0], yy[..., None] - discs[:, 1]) - discs[:, 2],
            axis=-1,
        )
        differ = unpack(rows) != (d < 0)
        assert not (differ & (np.abs(d) > 0.05)).any()


@pytest.fixture(scope="module")
def seen() -> tuple[View, np.ndarray]:
    """A flat hand with the middle finger curled, drawn from the capsules' own polygons."""
    theta = np.zeros(20)
    theta[[8, 10, 11]] = np.radians([80.0, 95.0, 60.0])
    patches = Capsules(HandShape.default()).patches(theta[None], POSE, K)
    mask = np.zeros((SIDE, SIDE), np.uint8)
    for polygon in patches.corners[0]:
        cv2.fillConvexPoly(mask, cv2.convexHull(polygon.astype(np.float32)).round().astype(int), 1)
    outside = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 5)
    inside = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    gx, gy = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
    norm = np.hypot(gx, gy)
    view = View(
        contour=np.empty((0, 2)), normal=np.empty((0, 2)), inner=np.empty((0, 5)),
        sdf=(outside - inside).astype(np.float32),
        edge_strength=np.clip(norm / norm.max(), 0, 1),
        edge_x=-gx / np.maximum(norm, 1e-6), edge_y=-gy / np.maximum(norm, 1e-6),
        intrinsics=K, valid=np.array([0.0, 0.0, SIDE, SIDE]),
        grey=np.zeros((SIDE, SIDE), np.uint8),
    )  # fmt: skip
    return view, theta


@pytest.mark.parametrize("surface", [Cardboard(HandShape.default()), Capsules(HandShape.default())])
def test_the_truth_is_likelier_than_what_differs(surface, seen) -> None:
    view, theta = seen
    rng = np.random.default_rng(3)
    others = theta + 0.35 * rng.normal(size=(40, 20))
    likelihood = FingerLikelihood(surface, view, POSE, LikelihoodSettings())
    values = likelihood(np.vstack([theta, others]))
    assert (values[0] > values[1:]).mean() > 0.9


def test_bare_area_cannot_tell_which_finger_is_curled(seen) -> None:
    view, theta = seen
    other = np.zeros(20)
    other[[12, 14, 15]] = theta[[8, 10, 11]]  # the ring instead
    both = np.vstack([theta, other])
    surface = Capsules(HandShape.default())
    gaps = {}
    for term in ("area", "xor"):
        settings = LikelihoodSettings(silhouette=term, missing=0.999)  # edges next to mute
        values = FingerLikelihood(surface, view, POSE, settings)(both)
        gaps[term] = values[0] - values[1]
    assert gaps["xor"] > 3 * abs(gaps["area"])


def test_a_batch_is_the_same_as_one_by_one(seen) -> None:
    view, theta = seen
    batch = theta + 0.2 * np.random.default_rng(4).normal(size=(300, 20))
    likelihood = FingerLikelihood(Cardboard(HandShape.default()), view, POSE, LikelihoodSettings())
    together = likelihood(batch)
    alone = [likelihood(batch[k : k + 1])[0] for k in (0, 150, 299)]
    np.testing.assert_allclose(together[[0, 150, 299]], alone, atol=1e-9)


def test_overlap_is_one_for_the_truth_and_falls_with_a_shift(seen) -> None:
    view, theta = seen
    surface = Capsules(HandShape.default())
    bits = SilhouetteBits.of(view)
    shift = np.array([0.0, 5.0, 10.0, 20.0])
    t = POSE.t_mm + np.stack([shift, 0 * shift, 0 * shift], axis=1)
    R = np.broadcast_to(POSE.R, (4, 3, 3))
    values = capsule_overlap(surface.hand, np.tile(theta, (4, 1)), R, t, K, bits, 6.0)
    assert values[0] > 0.95
    assert (np.diff(values) < 0).all()


def test_a_side_that_should_be_seen_and_is_not_counts_against_the_hand(seen) -> None:
    """In a frame without any edge each visible sample is a miss, and a hidden one is nothing."""
    view, _ = seen
    blank = replace(view, edge_strength=np.zeros_like(view.edge_strength))
    surface, settings = Cardboard(HandShape.default()), LikelihoodSettings(missing=0.2)
    flat, fist = np.zeros((1, 20)), np.zeros((1, 20))
    fist[0, [4, 6, 7, 8, 10, 11, 12, 14, 15, 16, 18, 19]] = 1.4
    misses = []
    for theta in (flat, fist):
        patches = surface.patches(theta, POSE, K)
        misses.append(edge_term(patches, blank, settings)[0] / np.log(settings.missing))
    np.testing.assert_allclose(misses, np.round(misses), atol=1e-9)
    assert 0 < misses[1] < misses[0] <= len(surface.sample_patch)
