"""Small scenes, and OpenGL where there is any."""

from dataclasses import replace

import pytest

from handtrack.camera import Camera
from synth.render import NoGLError, Renderer
from synth.scene import Scene


@pytest.fixture(scope="session")
def gl() -> None:
    """Skip where the smooth hand cannot be drawn."""
    try:
        with Renderer(Camera.assumed_for(64, 64)):
            pass
    except NoGLError as error:
        pytest.skip(str(error))


@pytest.fixture
def tiny() -> Scene:
    """Four small frames of the smooth hand."""
    scene = Scene(seed=5, width_px=160, height_px=120, focal_px=150.0)
    return replace(scene, motion=replace(scene.motion, frames=4, open_frames=1))


@pytest.fixture
def cardboard(tiny: Scene) -> Scene:
    """The same of cardboard."""
    return replace(tiny, surface="cardboard")
