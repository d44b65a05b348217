"""What the layers say, against pictures whose content is known."""

import cv2
import numpy as np
import pytest

from handtrack.camera import Camera
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import see, window_around
from handtrack.evidence.silhouette import Segmenter
from handtrack.hand.capsules import capsule_distance
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import TIPS
from handtrack.hand.space import default
from handtrack.hand.surface import Capsules, Cardboard
from handtrack.layers import Cloud, FrameLayers, Seen, Workings, layers_of, seen_by
from handtrack.paper import PaperMethod
from handtrack.records import Frame, FrameResult, Pose, Status
from handtrack.refine.matches import contour_pairs
from handtrack.refine.sweep import SweepSettings
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings
from handtrack.report import result_of

CAMERA = Camera.assumed_for(640, 480)
SHAPE, SPACE = HandShape.default(), default()
#: A little left of the middle, so that a mirrored layer would be found out.
POSE = Pose(np.diag([1.0, -1.0, -1.0]), np.array([-60.0, 90.0, 480.0]))
THETA = SPACE.to_angles(0.4 * SPACE.basis_X[9])


def drawn(theta, pose, camera):
    """A picture and a mask of the model's capsules, by the surface's polygons alone."""
    K = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    mask = np.zeros((camera.height_px, camera.width_px), np.uint8)
    for polygon in Capsules(SHAPE).patches(theta[None], pose, K).corners[0]:
        fixed = np.round(polygon * 16).astype(np.int32)
        cv2.fillConvexPoly(mask, fixed, 1, cv2.LINE_8, 4)
    image = np.full((*mask.shape, 3), 60, np.uint8)
    image[mask > 0] = (210, 150, 130)
    return image, mask > 0


def seen_on(side, method_class=RefinedMethod):
    """What a tracker sees of the model drawn in a frame, and its result; the frame as filmed."""
    tracked = CAMERA.mirrored() if side == "left" else CAMERA
    image, mask = drawn(THETA, POSE, tracked)
    evidence = see(image, window_around(mask), tracked, Segmenter.from_mask(image, mask))
    method = method_class(SHAPE, SPACE, RefinedSettings(sweep=SweepSettings(samples=60)))
    predicted = Estimate(POSE, THETA, np.full(20, 0.1))
    method.restart(predicted)
    estimate = method.follow(View.of(evidence), predicted, np.random.default_rng(0))
    result = result_of(Frame(4, 0.1, image), estimate, Status.TRACKED, 1.0, side, SHAPE, CAMERA)
    filmed = image[:, ::-1] if side == "left" else image
    return Seen(4, evidence, estimate, method.workings), result, filmed


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("method", [RefinedMethod, PaperMethod])
def test_layers_lie_on_the_frame_as_filmed(side, method):
    seen, result, filmed = seen_on(side, method)
    layers = layers_of(seen, result, CAMERA)
    inside = (filmed[..., 0] > 128).astype(np.uint8)
    off = cv2.distanceTransform(inside, cv2.DIST_L2, 5)
    off += cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5)

    def distance(points):
        x, y = points.round().astype(int).T
        return off[y, x]

    assert len(layers.contour) > 200
    assert np.quantile(distance(layers.contour), 0.95) < 2.5
    assert np.quantile(distance(layers.edges[:, :2]), 0.5) < 2.5
    assert np.quantile(distance(layers.pairs[:, :2]), 0.9) < 2.5
    corners = layers.patches.reshape(-1, 2)
    K = result.keypoints_px
    assert corners.min(axis=0) == pytest.approx(K.min(axis=0), abs=30)
    assert corners.max(axis=0) == pytest.approx(K.max(axis=0), abs=45)
    heaviest = np.argmax(layers.cloud_weight)
    tip = TIPS[layers.cloud_digit[heaviest]] if layers.tips.shape[1] == 1 else TIPS[0]
    assert np.linalg.norm(layers.tips[heaviest, 0] - K[tip]) < 40


def test_the_left_hand_is_the_mirror_image_of_the_right():
    (seen_r, result_r, _), (seen_l, result_l, _) = seen_on("right"), seen_on("left")
    right = layers_of(seen_r, result_r, CAMERA)
    # the same tracked picture, but for the camera's centre, which is in the middle of both
    left = layers_of(seen_l, result_l, CAMERA)
    for name in ("contour", "patches", "tips"):
        a, b = getattr(right, name), getattr(left, name)
        np.testing.assert_allclose(b[..., 0], 639 - a[..., 0], atol=1e-6)
        np.testing.assert_allclose(b[..., 1], a[..., 1], atol=1e-6)
    np.testing.assert_allclose(left.pairs[:, [0, 2]], 639 - right.pairs[:, [0, 2]], atol=1e-6)
    np.testing.assert_array_equal(left.cloud_X, right.cloud_X)


def test_matches_end_on_the_nearest_outline_that_faces_them():
    seen, _, _ = seen_on("right")
    method = RefinedMethod(SHAPE, SPACE, RefinedSettings())
    view = View.of(seen.evidence)
    moved = Estimate(Pose(POSE.R, POSE.t_mm + np.array([6.0, -4.0, 0.0])), THETA, np.full(20, 0.1))
    pairs = contour_pairs(method.refiner, view, moved)
    assert len(pairs) > 100
    circles = method.hand.circles_px(
        moved.theta[None], moved.pose.R, moved.pose.t_mm, view.intrinsics
    )[0]

    def distances(point):
        return [
            capsule_distance(*point, *circles[a, :3], *circles[b, :3])[0]
            for a, b in method.hand.capsule_node
        ]

    for x, y, foot_x, foot_y in pairs[::5]:
        length = np.hypot(foot_x - x, foot_y - y)
        assert np.abs(distances((foot_x, foot_y))).min() < 1e-6
        assert length >= np.abs(distances((x, y))).min() - 1e-6  # none is nearer than the nearest


def test_a_sweep_is_shown_as_what_it_was():
    seen, result, _ = seen_on("right")
    cloud, layers = seen.workings.cloud, layers_of(seen, result, CAMERA)
    assert (layers.cloud_kind, layers.cloud_size, len(layers.cloud_X)) == ("samples", 300, 200)
    for digit in range(5):
        own = cloud.digit == digit
        assert cloud.weight[own].max() == 1.0
        others = np.delete(cloud.theta[own], slice(4 * digit, 4 * digit + 4), axis=1)
        assert np.ptp(others, axis=0).max() == 0  # the rest of the hand is held
        assert layers.cloud_weight[layers.cloud_digit == digit].max() == 1.0
    points = CAMERA.project(cloud.pose @ keypoints_mm(cloud.theta[[100]], SHAPE)[0])
    tip = points[TIPS[cloud.digit[100]]]
    window = seen.evidence.window
    assert np.isfinite(window.to_window(tip)).all()


def test_particles_are_shown_as_particles():
    theta = np.zeros((300, 20))
    cloud = Cloud.of_particles(theta, np.linspace(0, 1, 300), POSE)
    seen, result, _ = seen_on("right")
    surface = Cardboard(SHAPE)
    workings = Workings(surface, SHAPE, SPACE, cloud, lambda e: np.empty((0, 4)), -12.5)
    layers = layers_of(Seen(4, seen.evidence, seen.estimate, workings), result, CAMERA)
    assert (layers.cloud_kind, layers.cloud_size, layers.tips.shape) == (
        "particles", 300, (200, 5, 2),
    )  # fmt: skip
    wanted = CAMERA.project(POSE @ keypoints_mm(theta[:1], SHAPE)[0, list(TIPS)])
    np.testing.assert_allclose(layers.tips[0], wanted)
    assert layers.log_likelihood == -12.5
    assert layers.cloud_weight.max() == 1.0
    line = SPACE.nearest_line(SPACE.to_X(seen.estimate.theta)[None])
    np.testing.assert_array_equal(layers.line, line.pair[0])


def test_of_a_lost_hand_there_is_what_was_seen_but_no_model():
    seen, _, _ = seen_on("right")
    layers = layers_of(seen, FrameResult.unknown(4, 0.1, side="right"), CAMERA)
    assert len(layers.contour) > 200
    assert len(layers.patches) == len(layers.pairs) == 0
    assert np.isnan(layers.X).all()


def test_what_was_seen_in_another_frame_is_not_shown():
    seen, result, _ = seen_on("right")
    tracker = type("Tracker", (), {"seen": seen})()
    assert seen_by(tracker, 4) is seen
    assert seen_by(tracker, 5) is None
    assert seen_by(object(), 4) is None
    assert len(layers_of(None, result, CAMERA).contour) == 0
    assert len(FrameLayers.none().tips) == 0
