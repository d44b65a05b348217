"""The fixed-lag smoother: what it must leave alone, and what it takes away."""

from dataclasses import replace

import numpy as np
import pytest

from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.shape import HandShape
from handtrack.records import FrameResult
from handtrack.report import in_camera
from handtrack.steady import Steadier

CAMERA = Camera.assumed_for(640, 480)
SHAPE = HandShape.default()
RATE = 30.0


def result(k: int, theta: np.ndarray, R: np.ndarray, side: str = "right") -> FrameResult:
    t_mm = np.array([0.5 * k, 40.0, 450.0])
    points = in_camera(theta, R, t_mm, side, SHAPE)
    return replace(
        FrameResult.unknown(k, k / RATE, side=side),
        theta=theta, R=R, t_mm=t_mm, keypoints_mm=points, keypoints_px=CAMERA.project(points),
    )  # fmt: skip


def clip(bend: np.ndarray, side: str = "right") -> list[FrameResult]:
    """All angles follow ``bend`` ``(F,)``; the palm turns slowly."""
    return [
        result(k, np.full(20, b), rotation.exp([0.0, 0.01 * k, 0.0]), side)
        for k, b in enumerate(bend)
    ]


def steadied(rows: list[FrameResult], width_s: float = 0.25) -> list[FrameResult]:
    steadier: Steadier[int] = Steadier(width_s, CAMERA)
    out = [o for row in rows for o in steadier.push(row, SHAPE, row.index)]
    out += steadier.flush()
    assert [extra for _, extra in out] == [r.index for r, _ in out] == [r.index for r in rows]
    return [r for r, _ in out]


def angles(rows: list[FrameResult]) -> np.ndarray:
    return np.array([row.theta[0] for row in rows])


@pytest.mark.parametrize("side", ["right", "left"])
def test_even_motion_stays_as_it_is(side: str) -> None:
    rows = clip(np.linspace(0.1, 0.6, 40), side)
    for a, b in list(zip(rows, steadied(rows), strict=True))[4:-4]:
        np.testing.assert_allclose(b.theta, a.theta, atol=1e-9)
        np.testing.assert_allclose(b.R, a.R, atol=1e-9)
        np.testing.assert_allclose(b.keypoints_px, a.keypoints_px, atol=1e-6)


def test_trembling_goes_and_nothing_comes_late() -> None:
    k = np.arange(300)
    motion = 0.5 + 0.4 * np.sin(2 * np.pi * k / 60)
    noise = np.random.default_rng(0).normal(0, 0.02, len(k))
    found = angles(steadied(clip(motion + noise)))
    second = np.abs(np.diff(found, 2)).mean(), np.abs(np.diff(motion + noise, 2)).mean()
    assert second[0] < 0.3 * second[1]
    errors = [np.abs(found[10 + s : 290 + s] - motion[10:290]).mean() for s in (-1, 0, 1)]
    assert np.argmin(errors) == 1


def test_width_zero_is_no_change() -> None:
    rows = clip(np.random.default_rng(1).normal(size=20))
    assert all(a is b for a, b in zip(rows, steadied(rows, 0.0), strict=True))


def test_a_gap_a_change_of_hand_and_a_jump_are_not_crossed() -> None:
    low, high = clip(np.zeros(24))[:12], clip(np.ones(24))[12:]
    gap = [*low[:11], FrameResult.unknown(11, 11 / RATE), *high]
    assert set(np.round(angles(steadied(gap))[[0, 10, 12, 20]], 9)) == {0.0, 1.0}
    assert np.isnan(steadied(gap)[11].theta).all()
    other = [*low, *(replace(row, side="left") for row in high)]
    np.testing.assert_allclose(angles(steadied(other)), np.repeat([0.0, 1.0], 12), atol=1e-12)
    turned = [*low, *(replace(row, R=row.R @ rotation.exp([0, 1.0, 0])) for row in high)]
    np.testing.assert_allclose(angles(steadied(turned)), np.repeat([0.0, 1.0], 12), atol=1e-12)


def test_holds_few_frames_however_quickly_they_come() -> None:
    steadier: Steadier[None] = Steadier(10.0, CAMERA)
    given = 0
    for row in clip(np.zeros(100)):
        given += len(steadier.push(row, SHAPE, None))
    assert given == 100 - 16
    assert len(steadier._rows) < 50


def test_mean_of_turns_is_the_turn_half_way() -> None:
    R = [rotation.exp([0.0, 0.0, a]) for a in (0.0, 0.2, 0.4)]
    rows = [result(k, np.zeros(20), r) for k, r in enumerate(R)]
    found = steadied(rows, 4 / RATE)
    np.testing.assert_allclose(found[1].R, R[1], atol=1e-12)
    np.testing.assert_allclose(found[0].R, rotation.exp([0.0, 0.0, 0.2 / 3]), atol=1e-4)
