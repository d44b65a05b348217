"""Who plays the hand: the smooth skin (pyrender), the paper's cardboard or balls
(software), or a hand that somebody else modelled.

An actor draws one instant as a premultiplied RGBA layer and says where bare skin is.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synth.cardboard import CardboardActor
from synth.handspec import HandSpec
from synth.kinematics import Bending, mirror
from synth.layer import Layer
from synth.light import lamps, shade
from synth.model import ModelActor
from synth.paint import dress, paint
from synth.render import Renderer
from synth.scene import Scene
from synth.skin import Skin
from synth.spheres import SpheresActor
from synth.surface import FOREARM_LENGTH_MM, rest_mesh
from synth.tones import some_cloth

Array = NDArray[np.float64]
_STUB_MM = 32.0
_CUFF_MM = 45.0


class Actor(Protocol):
    """Draws the hand; a context manager because it may hold an OpenGL context."""

    def __enter__(self) -> "Actor": ...
    def __exit__(self, *_: object) -> None: ...
    def bent(self, theta: Array) -> tuple[Array, Array]:
        """What hands are in truth that are asked for angles ``(F, 20)``.

        Keypoints ``(F, 21, 3)``, mm, in the palm's frame of a right hand, and angles ``(F, 20)``.
        """
        ...

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant: angles ``(20,)``, palm to camera, turn of the forearm ``(2,)``."""
        ...


def make_actor(scene: Scene) -> Actor:
    """The actor that ``scene`` asks for.

    Raises
    ------
    NoGLError
        The smooth hand is asked for and there is no OpenGL.
    """
    return _ACTORS[scene.surface](scene)


class SmoothActor(Bending):
    """The skinned hand."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(HandSpec.named(scene.hand))
        self._look, self._lamps = scene.look, lamps(scene.look, scene.seed)
        rng = np.random.default_rng([scene.seed, 1])
        self._renderer = Renderer(scene.camera)
        bare = self._look.forearm == "stub"
        self._skin = Skin(rest_mesh(self.hand, _STUB_MM if bare else FOREARM_LENGTH_MM), self.hand)
        self._albedo = paint(self._skin, self._look.skin, rng)
        self._is_skin: Array | None = None
        if self._look.forearm == "sleeve":
            cloth = some_cloth(rng)
            self._albedo, self._is_skin = dress(self._albedo, self._skin.mesh, _CUFF_MM, cloth)
        self._S = mirror(scene.side)
        faces = self._skin.mesh.faces
        self._faces = np.ascontiguousarray(faces[:, ::-1]) if scene.side == "left" else faces

    def __enter__(self) -> "SmoothActor":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.__exit__()

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant."""
        v = self._skin.pose(theta, (float(wrist[0]), float(wrist[1])))
        normals = (self._skin.normals(v) * self._S) @ R.T
        seen = (v * self._S) @ R.T + t_mm
        colours = shade(seen, normals, self._faces, self._albedo, *self._lamps)
        rgba = self._renderer.draw(seen, self._faces, colours)
        if self._is_skin is None:
            return Layer(rgba, rgba[..., 3] >= 128)
        label = self._renderer.draw(seen, self._faces, self._is_skin)
        return Layer(rgba, label[..., 0] >= 128)


_ACTORS: dict[str, Callable[[Scene], Actor]] = {
    "smooth": SmoothActor,
    "cardboard": CardboardActor,
    "spheres": SpheresActor,
    "model": ModelActor,
}
