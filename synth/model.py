"""An actor whose hand somebody else modelled, now and then with face and shirt behind it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from synth import complexion
from synth.arm import Arm, angles_of
from synth.kinematics import mirror
from synth.layer import Layer
from synth.light import lamps, shade
from synth.makehuman import some_arm, some_body
from synth.paint import dress
from synth.render import Renderer
from synth.scene import Scene
from synth.surface import Mesh
from synth.tones import TONES, linear, some_cloth
from synth.webxr import read_hand

Array = NDArray[np.float64]

_STUB_MM, _FOREARM_MM, _CUFF_MM = 32.0, 260.0, 45.0
#: Where somebody's eyes are, off the middle of what the hand keeps to, and how much of its way the
#: body goes along.
_BODY_MM = ((-140.0, -60.0, 170.0), (140.0, 130.0, 420.0))
_ALONG = 0.08
#: No more of a body is drawn, mm below its eyes.
_BODY_ENDS_MM = 900.0


class ModelActor:
    """A right or a left hand as its maker shaped it."""

    def __init__(self, scene: Scene) -> None:
        look, rng = scene.look, np.random.default_rng([scene.seed, 1])
        arm_rng, colour_rng, body_rng = rng.spawn(3)
        self._arm = _some_hand(scene.model, arm_rng)
        self._body = some_body(Path(look.body), arm_rng) if look.body else None
        self._S = mirror(scene.side)
        self._lamps = lamps(look, scene.seed)
        tone = linear(np.array(TONES[look.skin], float))
        mesh = self._arm.mesh
        albedo = complexion.of_arm(self._arm, tone, colour_rng)
        is_skin = np.ones_like(albedo)
        if look.forearm == "sleeve":
            albedo, is_skin = dress(albedo, mesh, _CUFF_MM, some_cloth(colour_rng))
        end = -_STUB_MM if look.forearm == "stub" else -_FOREARM_MM
        faces = mesh.faces[(mesh.vertices[mesh.faces][:, :, 1] > end).all(axis=1)]
        self._faces = faces[:, ::-1] if scene.side == "left" else faces
        self._middle = np.array([*scene.motion.centre_mm, scene.motion.distance_mm])
        if self._body is not None:
            self._normals = self._body.mesh.normals(self._body.mesh.vertices)
            self._eyes_mm = body_rng.uniform(*_BODY_MM) + self._middle
            shirt = linear(some_cloth(body_rng))
            skin_of_body = complexion.of_body(self._body, tone, shirt, body_rng)
            albedo = np.vstack([albedo, skin_of_body])
            is_skin = np.vstack([is_skin, np.zeros_like(skin_of_body)])
            self._faces = np.vstack([self._faces, _near(self._body.mesh) + len(mesh.vertices)])
        is_skin[:, 3] = 1.0
        self._albedo, self._is_skin = albedo, is_skin
        self._faces = np.ascontiguousarray(self._faces)
        self._renderer = Renderer(scene.camera)

    def __enter__(self) -> "ModelActor":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.__exit__()

    def bent(self, theta: Array) -> tuple[Array, Array]:
        """As :meth:`synth.actor.Actor.bent`, about so."""
        joints = np.array([self._arm.posed(row, np.zeros(2))[1] for row in theta])
        wrist = np.zeros((len(theta), 1, 3))
        keypoints = np.concatenate([wrist, joints.reshape(len(theta), 20, 3)], axis=1)
        return keypoints, np.array([angles_of(row) for row in joints])

    def draw(self, theta: Array, R: Array, t_mm: Array, wrist: Array) -> Layer:
        """One instant; bare skin is the hand's and the forearm's."""
        v, _ = self._arm.posed(theta, wrist)
        normals = (self._arm.mesh.normals(v) * self._S) @ R.T
        seen = (v * self._S) @ R.T + t_mm
        if self._body is not None:
            at = self._eyes_mm + _ALONG * (t_mm + R @ (0.0, 75.0, 0.0) - self._middle)
            seen = np.vstack([seen, self._body.mesh.vertices + at])
            normals = np.vstack([normals, self._normals])
        colours = shade(seen, normals, self._faces, self._albedo, *self._lamps)
        rgba = self._renderer.draw(seen, self._faces, colours)
        label = self._renderer.draw(seen, self._faces, self._is_skin)
        return Layer(rgba, label[..., 0] >= 128)


def _some_hand(model: str, rng: np.random.Generator) -> Arm:
    """The hand in a GLB file, or somebody's whose body is in MakeHuman's folder."""
    if not model:
        wanted = "a GLB file of a hand or MakeHuman's folder"
        raise InputError(f'scene: surface = "model" wants a model: {wanted}')
    return some_arm(Path(model), rng) if Path(model).is_dir() else read_hand(Path(model))


def _near(mesh: Mesh) -> NDArray[np.int32]:
    """Faces ``(m, 3)`` of a body that a picture of its face may show."""
    return mesh.faces[(mesh.vertices[mesh.faces][:, :, 1] < _BODY_ENDS_MM).all(axis=1)]
