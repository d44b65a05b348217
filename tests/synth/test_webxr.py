"""A hand with WebXR's joints, on a GLB file of little boxes."""

import itertools
import json
import struct

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from synth.webxr import read_hand

CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)), float)
#: Two triangles of each side of a box.
SIDES = np.array(
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)
TRIANGLES = np.concatenate([SIDES[:, [0, 1, 2]], SIDES[:, [0, 2, 3]]])
FINGERS = ("index", "middle", "ring", "pinky")
PARTS = ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")


def joints_of_a_hand() -> dict[str, np.ndarray]:
    """WebXR's joints in the default hand, metres, turned over and away from the origin."""
    points = keypoints_mm(np.zeros(20), HandShape.default()) / 1000
    points = points @ np.diag([1.0, -1.0, -1.0]) + [0.3, 0.2, -0.1]
    names = ["wrist", *(f"thumb-{p}" for p in ("metacarpal", *PARTS[::2], "tip"))]
    names += [f"{finger}-finger-{part}" for finger in FINGERS for part in PARTS]
    found = dict(zip(names, points, strict=True))
    for finger in FINGERS:
        knuckle = found[f"{finger}-finger-phalanx-proximal"]
        found[f"{finger}-finger-metacarpal"] = 0.8 * found["wrist"] + 0.2 * knuckle
    return found


def glb_of(joints: dict[str, np.ndarray]) -> bytes:
    """A box about every joint, whose first corner is there twice, as at a seam."""
    names, n = list(joints), len(joints)
    boxes = np.array([at + 0.004 * CORNERS for at in joints.values()])  # (n, 8, 3)
    positions = np.concatenate([boxes, boxes[:, :1]], axis=1).reshape(-1, 3)
    faces = TRIANGLES.copy()
    faces[0, 0] = 8  # the twin of corner 0
    indices = (faces[None] + 9 * np.arange(n)[:, None, None]).ravel()
    bones = np.zeros((9 * n, 4), np.uint8)
    bones[:, 0] = np.repeat(np.arange(n), 9)
    weights = np.tile(np.float32([1, 0, 0, 0]), (9 * n, 1))
    inverse = np.tile(np.eye(4, dtype=np.float32), (n, 1, 1))
    inverse[:, :3, 3] = -np.array(list(joints.values()))
    blocks = [
        (positions.astype("<f4"), 5126, "VEC3"),
        (bones, 5121, "VEC4"),
        (weights, 5126, "VEC4"),
        (indices.astype("<u2"), 5123, "SCALAR"),
        (inverse.transpose(0, 2, 1).astype("<f4"), 5126, "MAT4"),
    ]
    body, views, accessors = b"", [], []
    for array, kind, shape in blocks:
        views.append({"byteOffset": len(body)})
        count = array.size if shape == "SCALAR" else len(array)
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": kind, "type": shape, "count": count}
        )
        body += array.tobytes() + b"\0" * (-array.nbytes % 4)
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    document = {
        "nodes": [{"name": name} for name in names],
        "skins": [{"joints": list(range(n)), "inverseBindMatrices": 4}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_the_hand_is_the_one_in_the_file(tmp_path):
    path = tmp_path / "hand.glb"
    path.write_bytes(glb_of(joints_of_a_hand()))
    arm = read_hand(path)
    wanted = keypoints_mm(np.zeros(20), HandShape.default())[1:].reshape(5, 4, 3)
    np.testing.assert_allclose(arm.joints_mm, wanted, atol=0.01)
    assert len(arm.mesh.vertices) == 8 * 25  # twins are one
    np.testing.assert_allclose(arm.weights.sum(axis=1), 1.0)
    # the last bone of the index finger moves the boxes of its joint and of its tip
    last = arm.mesh.vertices[arm.weights[:, 2 + 3 + 2] == 1.0]
    assert len(last) == 16
    np.testing.assert_allclose(last.mean(axis=0), wanted[1, 2:].mean(axis=0), atol=0.01)


def test_faces_look_outwards(tmp_path):
    path = tmp_path / "hand.glb"
    path.write_bytes(glb_of(joints_of_a_hand()))
    mesh = read_hand(path).mesh
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(25 * 8.0**3, rel=0.05)


@pytest.mark.parametrize("joints", [{}, {"wrist": np.zeros(3)}])
def test_what_is_no_hand_is_refused(tmp_path, joints):
    path = tmp_path / "thing.glb"
    path.write_bytes(glb_of(joints) if joints else b"glTF")
    with pytest.raises(InputError, match="not a GLB file of a hand"):
        read_hand(path)
    with pytest.raises(InputError, match=r"missing\.glb"):
        read_hand(tmp_path / "missing.glb")
