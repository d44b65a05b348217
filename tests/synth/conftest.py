"""Small scenes."""

from dataclasses import replace

import pytest

from synth.scene import Scene


@pytest.fixture
def tiny() -> Scene:
    """Four small frames of the smooth hand."""
    scene = Scene(seed=5, width_px=160, height_px=120, focal_px=150.0)
    return replace(scene, motion=replace(scene.motion, frames=4, open_frames=1))


@pytest.fixture
def cardboard(tiny: Scene) -> Scene:
    """The same of cardboard."""
    return replace(tiny, surface="cardboard")
