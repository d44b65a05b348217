"""Who plays the hand: the smooth skin (pyrender) or the paper's cardboard (software).

An actor draws one instant as a premultiplied RGBA layer and says where bare skin is.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synth.handspec import HandSpec
from synth.light import shade
from synth.paint import dress, paint
from synth.render import Renderer
from synth.scene import Scene
from synth.skin import Skin
from synth.surface import FOREARM_LENGTH_MM, rest_mesh

Array = NDArray[np.float64]
_STUB_MM = 32.0
_CUFF_MM = 45.0


@dataclass(frozen=True, eq=False)
class Layer:
    """A drawn instant."""

    rgba: NDArray[np.uint8]  # (H, W, 4) premultiplied
    skin: NDArray[np.bool_]  # (H, W)


class Actor(Protocol):
    """Draws the hand; a context manager because it may hold an OpenGL context."""

    def __enter__(self) -> "Actor": ...
    def __exit__(self, *_: object) -> None: ...
    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant."""
        ...


def make_actor(scene: Scene) -> Actor:
    """The actor that ``scene`` asks for."""
    return SmoothActor(scene)


class SmoothActor:
    """The skinned hand."""

    def __init__(self, scene: Scene) -> None:
        hand = HandSpec.named(scene.hand)
        look = scene.look
        rng = np.random.default_rng([scene.seed, 1])
        length = _STUB_MM if look.forearm == "stub" else FOREARM_LENGTH_MM
        self._skin = Skin(rest_mesh(hand, length), hand)
        self._colours = paint(self._skin, look.skin, rng)
        self._clothed = look.forearm == "sleeve"
        if self._clothed:
            cloth = tuple(int(c) for c in rng.integers((20, 40, 60), (90, 120, 200)))
            self._colours = dress(self._colours, self._skin, _CUFF_MM, cloth)  # type: ignore[arg-type]
        self._S = np.array([-1.0 if scene.side == "left" else 1.0, 1.0, 1.0])
        self._faces = self._skin.mesh.faces
        if scene.side == "left":
            self._faces = np.ascontiguousarray(self._faces[:, ::-1])
        self._look = look
        self._renderer = Renderer(scene.camera)

    def __enter__(self) -> "SmoothActor":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.__exit__()

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant."""
        v = self._skin.pose(theta, (float(wrist[0]), float(wrist[1])))
        n = self._skin.normals(v) * self._S
        seen = (v * self._S) @ R.T + t_mm
        look = self._look
        colours = shade(seen, n @ R.T, self._faces, self._colours, look.lights, look.ambient)
        rgba = self._renderer.draw(seen, self._faces, colours)
        return Layer(rgba, rgba[..., 3] >= 128)
