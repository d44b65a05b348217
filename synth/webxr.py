"""A hand in a GLB file whose bones have the names that WebXR gives to the joints of a hand.

The generic hand of the npm package ``@webxr-input-profiles/assets`` (MIT) is one:
``dist/profiles/generic-hand/right.glb``. It ends at the wrist.
"""

import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from synth.arm import FIRST_DIGIT, Arm
from synth.surface import Mesh

Array = NDArray[np.float64]

_MM = 1000.0  # a metre
_KINDS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_THUMB = ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip")
_FINGER = ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
#: Joints of each digit from its root, W3C, "WebXR Hand Input Module", section 4.
_DIGITS = [[f"thumb-{part}" for part in _THUMB]]
_DIGITS += [
    [f"{name}-finger-{part}" for part in _FINGER] for name in ("index", "middle", "ring", "pinky")
]


@cache
def read_hand(path: Path) -> Arm:
    """The right hand in a GLB file.

    Raises
    ------
    InputError
        It cannot be read, or holds no hand with WebXR's joints.
    """
    try:
        document, body = _chunks(path.read_bytes())
        skin, mesh = document["skins"][0], document["meshes"][0]["primitives"][0]
        names = [document["nodes"][k]["name"] for k in skin["joints"]]
        at = {name: k for k, name in enumerate(names)}
        chains = [[at[name] for name in digit] for digit in _DIGITS]
        wrist = at["wrist"]
        values = {k: _accessor(document, body, n) for k, n in mesh["attributes"].items()}
        faces = _accessor(document, body, mesh["indices"])
        to_bones = _accessor(document, body, skin["inverseBindMatrices"])
    except (OSError, ValueError, KeyError, IndexError, struct.error) as error:
        what = "not a GLB file of a hand with WebXR's joints"
        raise InputError(f"{path}: {what} ({error!r})") from error
    heads_mm = np.linalg.inv(to_bones.reshape(-1, 4, 4).transpose(0, 2, 1))[:, :3, 3] * _MM
    # where a texture has a seam the file has a vertex twice
    vertices, first, twin = np.unique(
        values["POSITION"].round(6), axis=0, return_index=True, return_inverse=True
    )
    columns = np.ones(len(names), int)  # the palm
    for d, chain in enumerate(chains):
        columns[chain] = FIRST_DIGIT + 3 * d + np.array([0, 1, 2, 2])
    weights = np.zeros((len(vertices), FIRST_DIGIT + 15))
    rows = np.arange(len(vertices))[:, None]
    bones = columns[values["JOINTS_0"][first].astype(int)]
    np.add.at(weights, (rows, bones), values["WEIGHTS_0"][first])
    weights /= weights.sum(axis=1, keepdims=True)
    corners = twin.ravel()[faces.astype(int)].reshape(-1, 3).astype(np.int32)
    return Arm(Mesh(vertices * _MM, corners), weights, heads_mm[wrist], heads_mm[np.array(chains)])


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of a GLB file (Khronos, glTF 2.0, section 4.4)."""
    magic, _, _, length, kind = struct.unpack_from("<4sII I4s", data)
    if (magic, kind) != (b"glTF", b"JSON"):
        raise ValueError("no glTF header")
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def _accessor(document: dict[str, Any], body: bytes, number: int) -> Array:
    """Numbers ``(count, components)`` that lie one behind another."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    columns = _COUNTS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    kind = np.dtype(_KINDS[accessor["componentType"]]).newbyteorder("<")
    values = np.frombuffer(body, kind, accessor["count"] * columns, start)
    return values.reshape(-1, columns).astype(float)
