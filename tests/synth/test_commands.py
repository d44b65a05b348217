"""The demo and the synth command, with and without OpenGL."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from handtrack.hand.shape import HandShape
from handtrack.records import FrameResult, Status
from handtrack.run import run_clip
from synth import commands, render
from synth.clip import Truth
from synth.commands import Demo
from synth.render import NoGLError


class Oracle:
    """Says what is true, three pixels to the right and below."""

    def __init__(self, truth: Truth) -> None:
        self.truth, self.shape = truth, HandShape.default()
        self.timings_ms: dict[str, list[float]] = {}

    def step(self, frame):
        t, k = self.truth, frame.index
        return FrameResult(
            index=k,
            time_s=frame.time_s,
            status=Status.TRACKED,
            side="right",
            confidence=1.0,
            ess=1.0,
            R=t.R[k],
            t_mm=t.t_mm[k],
            theta=t.theta[k],
            theta_std=np.full(20, 0.1),
            keypoints_px=t.keypoints_px[k] + 3.0,
            keypoints_mm=t.keypoints_mm[k],
        )


@pytest.fixture
def oracle(monkeypatch, tmp_path):
    def make(*_):
        return Oracle(Truth.load(tmp_path / "clip" / "truth.npz"))

    def run_oracle(settings):  # as it says: its points are not those of its shape
        return run_clip(replace(settings, steady_s=0.0), make)

    monkeypatch.setattr(commands, "run_clip", run_oracle)


def test_the_demo_says_how_far_off_it_is(gl, oracle, tmp_path, capsys):
    assert Demo(out=tmp_path, frames=6, quiet=True)() == 0
    said = capsys.readouterr().out
    assert "angles between bones 0.0 deg" in said
    assert "keypoints 4.2 px" in said
    assert str(tmp_path / "found" / "overlay.mp4") in said
    assert "cardboard" not in said


def test_without_opengl_the_demo_draws_cardboard_and_says_so(oracle, monkeypatch, tmp_path, capsys):
    def nothing():
        raise NoGLError(render.NO_GL)

    monkeypatch.setattr(render, "_pyrender", nothing)
    assert Demo(out=tmp_path, frames=6, quiet=True)() == 0
    said = capsys.readouterr().out
    assert "libegl1" in said
    assert "drawing the cardboard hand" in said
    assert Truth.load(tmp_path / "clip" / "truth.npz").theta.shape == (6, 20)


def test_without_opengl_synth_names_the_packages(tmp_path):
    """In a process of its own, where PyOpenGL is told to use a library that is not there."""
    missing = os.environ | {"PYOPENGL_PLATFORM": "egl", "__EGL_VENDOR_LIBRARY_DIRS": "/nowhere"}
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "handtrack",
            "synth",
            "clean",
            "--frames",
            "2",
            "--out",
            str(tmp_path / "o"),
        ],
        env=missing,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 0:
        pytest.skip("OpenGL cannot be hidden from this machine")
    assert done.returncode == NoGLError.exit_code
    assert "libegl1-mesa" in done.stderr or "libgl1-mesa-dri" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "o").exists()
