"""ICP on silhouettes of posed hands: perturbed starts, one finger over, clutter, statuses."""

import numpy as np
import pytest

from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.palm.icp import IcpSettings, icp
from handtrack.palm.orthographic import other_tilt
from handtrack.palm.outline import Outline, palm_outline
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose

CAMERA = Camera.assumed_for(640, 480)
SIGNED = IcpSettings(signed_normals=True)
TRIALS = 25


def run(scene, start, extra=True, edges=None, normals=None, tips_px=None, settings=SIGNED):
    tips = scene.tips_px if tips_px is None else tips_px
    return icp(
        scene.outline_mm,
        scene.outline_normals,
        scene.edges_px if edges is None else edges,
        scene.edge_normals if normals is None else normals,
        start,
        CAMERA,
        (scene.tips_mm, tips, np.full(5, 2.0)) if extra else None,
        settings,
    )


def trials(make_scene, rotation_rad, shift_mm, over_mm=0.0, clutter=0, wrong_tip=False, **options):
    """Errors ``(TRIALS, 2)`` of the first pose: rotation in degrees, palm centre in pixels."""
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(TRIALS):
        scene = make_scene(rng)
        angle = rng.uniform(-np.pi, np.pi, clutter)
        more = scene.edges_px.mean(axis=0) + rng.uniform(-120, 120, (clutter, 2))
        edges = np.concatenate([scene.edges_px + rng.normal(0, 0.7, scene.edges_px.shape), more])
        normals = np.column_stack([np.cos(angle), np.sin(angle)])
        tips = scene.tips_px + rng.normal(0, 2, (5, 2))
        if wrong_tip:
            tips[rng.integers(5)] += 40
        result = run(
            scene,
            scene.start(rng, rotation_rad, shift_mm, over_mm),
            edges=edges,
            normals=np.concatenate([scene.edge_normals, normals]),
            tips_px=tips,
            **options,
        )
        assert result.status.usable, result.status.sentence
        errors.append(scene.errors(result.poses[0]))
    return np.array(errors)


@pytest.mark.parametrize(
    ("name", "options", "median_deg", "worst_px"),
    [
        ("near", {"rotation_rad": 0.05, "shift_mm": 3}, 3, 6),
        ("far", {"rotation_rad": 0.25, "shift_mm": 15}, 3, 6),
        ("one finger over", {"rotation_rad": 0.1, "shift_mm": 5, "over_mm": 20}, 3, 6),
        ("one finger back", {"rotation_rad": 0.1, "shift_mm": 5, "over_mm": -20}, 3, 6),
        ("clutter", {"rotation_rad": 0.1, "shift_mm": 8, "clutter": 150}, 4, 8),
        ("a wrong tip", {"rotation_rad": 0.1, "shift_mm": 5, "wrong_tip": True}, 6, 25),
    ],
)
def test_converges_from_perturbed_starts(make_scene, name, options, median_deg, worst_px):
    errors = trials(make_scene, **options)
    print(f"{name}: median {np.median(errors, axis=0)}, worst {errors.max(axis=0)} (deg, px)")
    assert np.median(errors[:, 0]) < median_deg
    assert np.quantile(errors[:, 1], 0.9) < worst_px


def test_the_outline_alone_keeps_a_tracked_palm(make_scene):
    """Without fingertips the palm's sides say little about its tilt: it must not get worse."""
    errors = trials(make_scene, rotation_rad=0.05, shift_mm=4, extra=False)
    assert np.median(errors[:, 0]) < 6
    assert np.median(errors[:, 1]) < 2.5


def test_unsigned_normals_do_nearly_as_well(make_scene):
    errors = trials(make_scene, 0.1, 8, settings=IcpSettings())
    assert np.median(errors[:, 0]) < 4


def test_orthographic_solver_is_the_papers_and_the_weaker(make_scene):
    paper = IcpSettings(solver="orthographic", signed_normals=True)
    errors = trials(make_scene, 0.05, 4, settings=paper)
    ours = trials(make_scene, 0.05, 4)
    print(f"orthographic: median {np.median(errors, axis=0)}; ours {np.median(ours, axis=0)}")
    assert np.median(errors[:, 1]) < 12
    assert np.median(ours[:, 0]) < np.median(errors[:, 0])


@pytest.mark.parametrize(("solver", "median_deg"), [("perspective", 8), ("orthographic", 12)])
def test_both_tilts_are_returned(make_scene, solver, median_deg):
    """Begun at the wrong tilt, the true one is among the two, whichever leads."""
    rng = np.random.default_rng(3)
    settings = IcpSettings(solver=solver, signed_normals=True)
    found, begun, pairs = [], [], 0
    for _ in range(TRIALS):
        scene = make_scene(rng)
        mirrored = other_tilt(scene.start(rng, 0.03, 2), scene.outline_mm.mean(axis=0))
        result = run(scene, mirrored, extra=False, settings=settings)
        assert result.status.usable, result.status.sentence
        assert len(result.poses) == len(result.costs)
        assert 0 <= result.ambiguity <= 1
        pairs += len(result.poses) == 2
        begun.append(scene.errors(mirrored)[0])
        found.append(min(scene.errors(pose)[0] for pose in result.poses))
    print(f"{solver}: begun {np.median(begun):.1f} deg off, nearer tilt {np.median(found):.1f}")
    assert pairs > 0.8 * TRIALS
    assert np.median(found) < median_deg < 0.5 * np.median(begun)


def test_the_fingers_decide_the_tilt(make_scene):
    """Bent fingers are off the palm's plane: with them, the true tilt costs less."""
    rng = np.random.default_rng(5)
    first = []
    for _ in range(TRIALS):
        scene = make_scene(rng, tilt_rad=0.8)
        first.append(scene.errors(run(scene, scene.start(rng, 0.1, 5)).poses[0])[0])
    assert np.mean(np.array(first) < 8) > 0.9


def test_result_counts_add_up(make_scene):
    rng = np.random.default_rng(0)
    scene = make_scene(rng)
    result = run(scene, scene.start(rng, 0.05, 3))
    assert result.converged
    assert result.status is PalmStatus.CONVERGED
    assert 1 < result.iterations <= SIGNED.rounds
    assert len(scene.outline_mm) == result.samples >= len(result.matches) >= result.inliers > 20
    assert result.rms_px < 2
    assert len(set(result.matches[:, 1])) == len(result.matches)
    model, edge = result.matches.T
    gap = CAMERA.project(result.poses[0] @ scene.outline_mm[model]) - scene.edges_px[edge]
    assert np.median(np.linalg.norm(gap, axis=1)) < 3
    assert np.linalg.eigvalsh(result.information).min() > 0
    with pytest.raises(ValueError, match="read-only"):
        result.matches[0] = 0


def test_same_input_same_result(make_scene):
    scene = make_scene(np.random.default_rng(0))
    starts = [scene.start(np.random.default_rng(1), 0.1, 5) for _ in range(2)]
    a, b = (run(scene, start) for start in starts)
    assert np.array_equal(a.poses[0].R, b.poses[0].R)
    assert a.costs == b.costs


@pytest.mark.parametrize("solver", ["perspective", "orthographic"])
def test_failures_are_statuses(make_scene, solver):
    rng = np.random.default_rng(0)
    scene = make_scene(rng)
    settings = IcpSettings(solver=solver)
    start = scene.start(rng, 0.05, 3)
    none = np.empty((0, 2))
    far = scene.edges_px + 5000
    cases = {
        "no edges": (start, none, none, PalmStatus.TOO_FEW_POINTS),
        "far away": (start, far, scene.edge_normals, PalmStatus.TOO_FEW_POINTS),
        "behind": (Pose(start.R, -start.t_mm), None, None, PalmStatus.BEHIND_CAMERA),
        "unknown": (Pose(start.R, start.t_mm * np.nan), None, None, PalmStatus.BAD_START),
        "no rotation": (Pose(start.R * 2, start.t_mm), None, None, PalmStatus.BAD_START),
    }
    for name, (begin, edges, normals, status) in cases.items():
        result = run(scene, begin, False, edges, normals, settings=settings)
        assert result.status is status, name
        assert not result.converged
        assert result.inliers == 0
        assert np.array_equal(result.poses[0].R, begin.R)
    short = IcpSettings(solver=solver, rounds=2)
    assert run(scene, start, settings=short).status is PalmStatus.ROUND_LIMIT


def test_unknown_tips_are_left_out(make_scene):
    rng = np.random.default_rng(0)
    scene = make_scene(rng)
    tips = scene.tips_px.copy()
    tips[1:] = np.nan
    result = run(scene, scene.start(rng, 0.05, 3), tips_px=tips)
    assert result.status.usable
    assert np.isfinite(result.poses[0].R).all()


def test_bad_input_is_refused(make_scene):
    scene = make_scene(np.random.default_rng(0))
    with pytest.raises(InputError, match="outline"):
        icp(
            np.zeros((3, 2)),
            np.zeros((3, 2)),
            np.zeros((1, 2)),
            np.zeros((1, 2)),
            scene.pose,
            CAMERA,
        )
    with pytest.raises(InputError, match="extra"):
        run(scene, scene.pose, tips_px=np.zeros((2, 2)))
    for wrong in ({"rounds": 0}, {"gate_mm": 1.0}, {"shrink": 0.0}, {"min_matches": 2}):
        with pytest.raises(InputError, match="icp"):
            IcpSettings(**wrong)


def test_outline_normals_are_across_the_projected_outline():
    """In perspective and tilted, against the chord of neighbouring points."""
    points, normals = palm_outline(HandShape.default(), spacing_mm=1.0)
    along = np.column_stack([-normals[:, 1], normals[:, 0], 0 * normals[:, 0]])
    pose = Pose(
        np.array([[0.8, 0, 0.6], [0, -1, 0], [0.6, 0, -0.8]]), np.array([30.0, 40.0, 300.0])
    )
    pixels, image_normals = Outline(points, normals).seen(pose, CAMERA)
    chord = CAMERA.project(pose @ (points + 0.01 * along)) - pixels
    out = CAMERA.project(pose @ (points + 0.01 * normals)) - pixels
    assert np.allclose(np.sum(chord * image_normals, axis=1), 0, atol=1e-5)
    assert (np.sum(out * image_normals, axis=1) > 0).all()
    assert np.allclose(np.linalg.norm(image_normals, axis=1), 1)
