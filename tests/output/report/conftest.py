"""Reports of clips that never were: every frame shows its own number, and so do its layers."""

import shutil

import numpy as np
import pytest

from handtrack.hand import space
from handtrack.layers import FrameLayers
from handtrack.output.provenance import Counts
from handtrack.output.report.curves import TrueMotion
from handtrack.output.report.facts import facts_of
from handtrack.output.report.writer import ReportWriter
from handtrack.records import FrameResult, Status
from handtrack.run import RunSettings

WIDTH, HEIGHT, BLOCK, BITS = 203, 151, 16, 12


def numbered(k, width=WIDTH, height=HEIGHT):
    """A grey frame with the bits of ``k`` as black and white blocks along its top."""
    image = np.full((height, width, 3), 100, np.uint8)
    for bit in range(BITS):
        image[:BLOCK, bit * BLOCK : (bit + 1) * BLOCK] = 255 * (k >> bit & 1)
    return image


def number_of(image):
    """The number that a frame shows."""
    half = BLOCK // 2
    return sum(int(image[half, bit * BLOCK + half].mean() > 128) << bit for bit in range(BITS))


def keypoints_at(k):
    """Keypoints ``(21, 2)`` of frame ``k``: the wrist is at ``x = 20 + k mod 150``."""
    digits, joints = np.divmod(np.arange(20), 4)
    points = np.column_stack([4.0 * digits - 8.0, -8.0 * (joints + 1)])
    return np.vstack([[0.0, 0.0], points]) + np.array([20.0 + k % 150, 120.0])


def result_at(k, status=Status.TRACKED):
    if status is not Status.TRACKED:
        return FrameResult.unknown(k, k / 30, status)
    theta = np.radians(40 * np.sin(k / 20 + np.arange(20)) + 30)
    return FrameResult(
        index=k, time_s=k / 30, status=status, side="left", confidence=0.9, ess=20 + k % 7,
        R=np.eye(3), t_mm=np.array([0.0, 0, 400]), theta=theta,
        theta_std=np.full(20, np.radians(5.0)), keypoints_px=keypoints_at(k),
        keypoints_mm=np.zeros((21, 3)),
    )  # fmt: skip


def layers_at(k, n=40):
    """Layers of frame ``k``, each somewhere else; contours of different lengths."""
    turn = np.linspace(0, 2 * np.pi, n + k % 5, endpoint=False)
    circle = np.column_stack([100 + 30 * np.cos(turn), 80 + 30 * np.sin(turn)])
    square = np.array([[0.0, 0.0], [12, 0], [12, 12], [0, 12]])
    rng = np.random.default_rng(k)
    return FrameLayers(
        contour=circle,
        edges=np.column_stack([circle + 20, np.linspace(0, 1, len(circle))]),
        pairs=np.hstack([circle, circle - 4]),
        patches=square + np.array([[[60.0 + 20 * i, 60.0]] for i in range(3)]),
        patch_digit=np.array([-1, 0, 4]),
        patch_seen=np.array([1.0, 0.1, 0.8]),
        tips=rng.uniform(40, 140, (30, 1, 2)),
        cloud_X=rng.normal(0, 0.5, (30, 2)),
        cloud_weight=rng.random(30),
        cloud_digit=np.arange(30) % 5,
        cloud_kind="samples",
        cloud_size=450,
        X=np.array([np.sin(k / 30), np.cos(k / 30)]),
        line=np.array([0, 5]),
        energy=50.0 + k % 11,
        log_likelihood=np.nan,
    )


def record_of(n, name="numbered.mp4"):
    """As much of a run's record as the report reads."""
    return {
        "state": "complete",
        "clip": {"name": name, "width_px": WIDTH, "height_px": HEIGHT},
        "counts": Counts(n, decoded=n, tracked=n),
        "side": "left",
        "hand": {"calibrated": True},
        "camera_assumed": True,
        "settings": RunSettings(name),
        "seed": 0,
    }


def write_report(folder, n, status=lambda k: Status.TRACKED, layers=layers_at, truth=None, ms=20.0):
    """The report of ``n`` numbered frames in ``folder``."""
    folder.mkdir(exist_ok=True)
    writer = ReportWriter(folder, WIDTH, HEIGHT)
    for k in range(n):
        writer.add(result_at(k, status(k)), numbered(k), lambda k=k: layers(k), ms + k % 3)
    writer.finish(facts_of(record_of(n), space.default()), truth)
    return folder


def truth_of(n):
    """A truth that lies 3 degrees and (3, 4) pixels beside the result."""
    results = [result_at(k) for k in range(n)]
    return TrueMotion(
        np.array([r.theta for r in results]) + np.radians(3.0),
        np.array([r.keypoints_px for r in results]) + np.array([3.0, 4.0]),
    )


@pytest.fixture(scope="session")
def reports():
    """The functions of this module, for tests (which cannot import it)."""
    return __import__("sys").modules[__name__]


@pytest.fixture(scope="session")
def browser():
    """A Chromium without a window."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no chromium here (apt-get install chromium): the page is not tested")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()
