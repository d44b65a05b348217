"""The smooth hand drawn by pyrender without a display (EGL, which Mesa does on a CPU).

pyrender gets vertices and finished colours (`synth.light`) and does what is left: perspective,
depth, anti-aliasing. The camera is OpenCV's; pyrender wants OpenGL's, which looks along -z, and
counts pixels from their corners where we count from their centres. Only a window about the hand
is drawn.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera, Window
from handtrack.errors import HandtrackError

Array = NDArray[np.float64]
NO_GL = (
    "the smooth hand needs OpenGL without a display (EGL): install libegl1 and libgl1-mesa-dri, "
    "or choose the cardboard hand, which is drawn in software"
)
_GL_FROM_CV = np.array([1.0, -1.0, -1.0])
_METRES = 1e-3
_TILE_PX = 64


class NoGLError(HandtrackError):
    """No OpenGL context can be made on this machine."""

    exit_code = 6


def _pyrender() -> Any:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    try:
        import pyrender
    except (ImportError, AttributeError, OSError) as error:  # PyOpenGL loads libraries here
        raise NoGLError(f"{NO_GL} ({error})") from error
    return pyrender


class Renderer:
    """Draws coloured meshes as RGBA; use it as a context manager."""

    def __init__(self, camera: Camera) -> None:
        self._pyrender = pr = _pyrender()
        self.camera = camera
        try:
            self._offscreen = pr.OffscreenRenderer(camera.width_px, camera.height_px)
        except Exception as error:  # pyrender lets through whatever EGL and PyOpenGL raise
            raise NoGLError(f"{NO_GL} ({error})") from error
        self._material = pr.MetallicRoughnessMaterial(baseColorFactor=(1.0, 1.0, 1.0, 1.0))
        self._scene = pr.Scene(bg_color=(0.0, 0.0, 0.0, 0.0))
        self._lens = self._scene.add(pr.IntrinsicsCamera(1.0, 1.0, 0.0, 0.0))

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self._offscreen.delete()

    def draw(
        self, vertices_mm: Array, faces: NDArray[np.int32], colours: Array
    ) -> NDArray[np.uint8]:
        """RGBA ``(H, W, 4)``, premultiplied, of a mesh ``(n, 3)`` in the camera frame.

        Parameters
        ----------
        vertices_mm : (n, 3)
            All of them in front of the camera.
        faces : (m, 3)
            Counter-clockwise from outside.
        colours : (n, 4)
            As they shall be displayed, 0 to 1.
        """
        pr, camera = self._pyrender, self.camera
        image = np.zeros((camera.height_px, camera.width_px, 4), np.uint8)
        window = self._window(vertices_mm)
        if window is None:
            return image
        self._aim(window)
        primitive = pr.Primitive(
            positions=(vertices_mm * (_GL_FROM_CV * _METRES)).astype(np.float32),
            indices=faces,
            color_0=colours.astype(np.float32),
            material=self._material,
            mode=4,
        )
        node = self._scene.add(_mesh(pr, primitive))
        try:
            part, _ = self._offscreen.render(
                self._scene, flags=pr.RenderFlags.RGBA | pr.RenderFlags.FLAT
            )
        finally:
            self._scene.remove_node(node)
        y, x = int(window.y_px), int(window.x_px)
        image[y : y + window.height_px, x : x + window.width_px] = part
        return image

    def _window(self, vertices_mm: Array) -> Window | None:
        """The tiles about the hand, or None where it is not in the image."""
        camera = self.camera
        px = camera.project(vertices_mm)
        size = np.array([camera.width_px, camera.height_px])
        low = np.clip(np.floor((px.min(axis=0) - 1) / _TILE_PX) * _TILE_PX, 0, size).astype(int)
        high = np.clip(np.ceil((px.max(axis=0) + 2) / _TILE_PX) * _TILE_PX, 0, size).astype(int)
        if (high <= low).any():
            return None
        return Window(float(low[0]), float(low[1]), 1.0, *(high - low).tolist())

    def _aim(self, window: Window) -> None:
        through = self.camera.through(window)
        lens = self._pyrender.IntrinsicsCamera(
            through.fx_px, through.fy_px, through.cx_px + 0.5, through.cy_px + 0.5, 0.02, 10.0
        )
        self._scene.remove_node(self._lens)
        self._lens = self._scene.add(lens, pose=np.eye(4))
        self._offscreen.viewport_width = window.width_px
        self._offscreen.viewport_height = window.height_px


def _mesh(pr: Any, primitive: Any) -> Any:
    """A pyrender mesh whose bounds do not ask NumPy 2 for ``np.infty``, as pyrender 0.1.45 does."""

    class Bounded(pr.Mesh):
        @property
        def bounds(self) -> Any:
            return primitive.bounds

    return Bounded([primitive])
