"""MakeHuman's people, on a small mesh of boxes that is laid out as MakeHuman's is."""

import gzip
import itertools
import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from handtrack import rotation
from handtrack.bench.training.people import PORTRAIT_PX, pictures, portraits
from handtrack.errors import InputError
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from synth.actor import make_actor
from synth.arm import angles_of
from synth.clip import write_clip
from synth.makehuman import some_arm, some_body
from synth.motion import FRONTAL

#: Where the right palm is in the body, and how it is turned: fingers down, the palm to the thigh.
AT_MM = np.array([-450.0, -300.0, 0.0])
TURN = np.array([[0, 0, 1.0], [0, -1.0, 0], [1.0, 0, 0]])
CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)), float)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
#: The flat hand whose boxes these are.
REST = np.zeros(20)


class Drawing:
    """An OBJ file, its rig and its weights."""

    def __init__(self):
        self.vertices, self.groups, self.rig, self.weights = [], {}, {}, {}

    def box(self, group, centre, half, bone=None):
        first = len(self.vertices)
        self.vertices += [centre + corner * half for corner in CORNERS]
        self.groups.setdefault(group, []).extend([[first + k for k in side] for side in SIDES])
        if bone:
            self.weights.setdefault(bone, []).extend([[first + k, 1.0] for k in range(8)])

    def bone(self, name, head, tail, parent, size=6.0):
        for end, at in (("head", head), ("tail", tail)):
            self.box(f"joint-{name}-{end}", at, 1.0)
        ends = {e: {"cube_name": f"joint-{name}-{e}", "strategy": "CUBE"} for e in ("head", "tail")}
        self.rig[name] = {**ends, "parent": parent}
        half = np.maximum(np.abs(tail - head) / 2, size)
        self.box("body", (head + tail) / 2, half, name)

    def write(self, folder):
        for name in ("3dobjs", "rigs/standard", "targets/macrodetails", "targets/hands"):
            (folder / name).mkdir(parents=True)
        lines = [f"v {x} {y} {z}" for x, y, z in np.array(self.vertices) / 100.0]
        for group, polygons in self.groups.items():
            lines += [f"g {group}"]
            lines += ["f " + " ".join(f"{k + 1}/1" for k in polygon) for polygon in polygons]
        (folder / "3dobjs/base.obj").write_text("\n".join(lines))
        (folder / "rigs/standard/rig.default.json").write_text(json.dumps(self.rig))
        weights = json.dumps({"weights": self.weights})
        (folder / "rigs/standard/weights.default.json").write_text(weights)


def write_targets(folder):
    """Targets that move nothing."""
    sexes, ages = ("male", "female"), ("young", "old", "child")
    origins, builds = ("african", "asian", "caucasian"), ("min", "average", "max")
    names = [f"macrodetails/{'-'.join(n)}" for n in itertools.product(origins, sexes, ages)]
    names += [
        f"macrodetails/universal-{sex}-{age}-{m}muscle-{w}weight"
        for sex, age, m, w in itertools.product(sexes, ages, builds, builds)
    ]
    names += [
        f"hands/r-hand-fingers-{what}-{way}"
        for what, way in itertools.product(("length", "diameter", "distance"), ("incr", "decr"))
    ]
    for name in names:
        with gzip.open(folder / "targets" / f"{name}.target.gz", "wt") as file:
            file.write("# nothing\n0 0 0 0\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    drawing = Drawing()
    hand = keypoints_mm(REST, HandShape.default()) @ TURN.T + AT_MM
    wrist, joints = hand[0], hand[1:].reshape(5, 4, 3)
    shoulder, elbow = np.array([-200.0, 200.0, 0]), wrist + np.array([0, 250.0, 0])
    drawing.bone("spine01", np.array([0, -300.0, 0]), np.array([0, 250.0, 0]), "", size=150.0)
    drawing.bone("head", np.array([0, 250.0, 0]), np.array([0, 500.0, 0]), "spine01", size=90.0)
    for side, x in (("l", 40.0), ("r", -40.0)):
        drawing.box(f"helper-{side}-eye", np.array([x, 400.0, 80]), 12.0, "head")
    drawing.bone("upperarm01.R", shoulder, elbow, "spine01", size=30.0)
    drawing.bone("lowerarm01.R", elbow, wrist, "upperarm01.R", size=25.0)
    drawing.bone("wrist.R", wrist, (wrist + joints[2, 0]) / 2, "lowerarm01.R", size=20.0)
    for d in range(1, 5):
        drawing.bone(f"metacarpal{d}.R", wrist, joints[d, 0], "wrist.R")
    for d, j in itertools.product(range(5), range(3)):
        parent = f"finger{d + 1}-{j}.R" if j else ("wrist.R" if d == 0 else f"metacarpal{d}.R")
        drawing.bone(f"finger{d + 1}-{j + 1}.R", joints[d, j], joints[d, j + 1], parent)
    path = tmp_path_factory.mktemp("makehuman")
    drawing.write(path)
    write_targets(path)
    return path


def test_the_hand_at_rest_is_the_one_that_was_drawn(folder):
    arm = some_arm(folder, np.random.default_rng(0))
    drawn = keypoints_mm(REST, HandShape.default())[1:].reshape(5, 4, 3)
    np.testing.assert_allclose(arm.joints_mm, drawn, atol=2.0)
    np.testing.assert_allclose(angles_of(arm.joints_mm), REST, atol=np.radians(4))
    np.testing.assert_allclose(arm.weights.sum(axis=1), 1.0)


def test_angles_come_back_as_the_fingers_were_bent(folder):
    arm = some_arm(folder, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    for _ in range(20):
        wanted = np.zeros((5, 4))
        wanted[1:] = np.radians(rng.uniform((-10, -3, 0, 0), (70, 3, 100, 70), (4, 4)))
        _, joints = arm.posed(wanted.ravel(), np.zeros(2))
        found = angles_of(joints).reshape(5, 4)
        np.testing.assert_allclose(found[1:, [0, 2, 3]], wanted[1:, [0, 2, 3]], atol=np.radians(6))
        lengths = np.linalg.norm(np.diff(joints, axis=1), axis=-1)
        at_rest = np.linalg.norm(np.diff(arm.joints_mm, axis=1), axis=-1)
        np.testing.assert_allclose(lengths, at_rest, rtol=1e-9)


def test_angles_are_those_of_our_own_hand_for_our_own_hand():
    rng = np.random.default_rng(2)
    theta = np.radians(rng.uniform(-8, 60, 20))
    joints = keypoints_mm(theta, HandShape.default())[1:].reshape(5, 4, 3)
    np.testing.assert_allclose(angles_of(joints), theta, atol=1e-9)


def test_the_surface_goes_with_its_bones(folder):
    arm = some_arm(folder, np.random.default_rng(0))
    bent = np.zeros(20)
    bent[4] = np.radians(70)  # the index finger
    v, joints = arm.posed(bent, np.array([0.3, 0.0]))
    index = arm.weights[:, 5:8].sum(axis=1) == 1.0
    others = arm.weights[:, [1, *range(8, 17)]].sum(axis=1) == 1.0
    rest = arm.posed(np.zeros(20), np.zeros(2))[0]
    np.testing.assert_allclose(v[others], rest[others], atol=1e-9)
    assert np.linalg.norm(v[index] - rest[index], axis=1).min() > 3
    turned = arm.weights[:, 0] == 1.0
    np.testing.assert_allclose(v[turned], rest[turned] @ rotation.exp([0.3, 0, 0]).T, atol=1e-9)
    assert joints[1, 3, 2] > 30  # bent towards the palm


def test_a_body_has_no_hands(folder):
    body = some_body(folder, np.random.default_rng(0))
    v = body.mesh.vertices
    assert v[:, 1].max() < 760  # the wrist is 700 mm below the eyes
    assert abs(v[body.eyes].mean(axis=0)).max() < 1e-6
    assert body.hair.any()
    assert not (body.hair & body.eyes).any()


def test_pictures_show_the_palm_where_they_say(folder, gl):
    for picture in islice(pictures(folder, np.random.default_rng(3)), 12):
        x, y = np.round(picture.at_px).astype(int)
        assert picture.alpha[y, x] > 128
        assert np.isfinite(picture.theta).all()
        np.testing.assert_allclose(picture.R @ picture.R.T, np.eye(3), atol=1e-9)


def test_portraits_are_pictures(folder, gl):
    one, other = islice(portraits(folder, np.random.default_rng(4)), 2)
    assert one.shape == (PORTRAIT_PX, PORTRAIT_PX, 3)
    assert one.std() > 5
    assert (one != other).any()


def test_another_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="not MakeHuman's data"):
        some_arm(tmp_path, np.random.default_rng(0))


@pytest.fixture
def filmed(tiny, folder):
    """Four small frames of somebody's hand."""
    return replace(tiny, surface="model", model=str(folder))


def test_a_clip_of_a_model_has_its_truth(filmed, gl, tmp_path):
    truth = write_clip(filmed, tmp_path)
    masks = np.unpackbits(truth.mask, axis=-1)[..., : filmed.width_px]
    palm = truth.keypoints_px[:, [0, 9]].mean(axis=1).round().astype(int)
    assert all(mask[y, x] for mask, (x, y) in zip(masks, palm, strict=True))
    assert not (tmp_path / "shape.toml").exists()
    lengths = np.linalg.norm(np.diff(truth.keypoints_mm[:, 5:9], axis=1), axis=-1)
    np.testing.assert_allclose(lengths, np.tile(lengths[0], (4, 1)), rtol=1e-9)


def test_a_left_hand_is_the_mirror_image(filmed, gl):
    def film(side):
        scene = replace(filmed, side=side)
        with make_actor(scene) as actor:
            layer = actor.draw(np.zeros(20), FRONTAL, np.array([0, 60.0, 440]), np.zeros(2))
        return layer.skin

    # the camera looks at the middle of the picture
    assert (film("left") == film("right")[:, ::-1]).mean() > 0.99


def test_somebody_stands_behind_the_hand(filmed, folder, gl):
    def middle(body):
        scene = replace(filmed, look=replace(filmed.look, body=body))
        with make_actor(scene) as actor:
            return actor.draw(np.zeros(20), FRONTAL, np.array([0, 60.0, 440]), np.zeros(2))

    alone, before = middle(""), middle(str(folder))
    drawn = [(layer.rgba[..., 3] > 0).sum() for layer in (alone, before)]
    assert drawn[1] > 1.5 * drawn[0]
    np.testing.assert_array_equal(alone.skin, before.skin)


def test_a_scene_that_names_no_model_is_refused(filmed):
    with pytest.raises(InputError, match="wants a model"):
        make_actor(replace(filmed, model=""))


def test_only_a_model_has_a_body(tiny):
    with pytest.raises(InputError, match=r"look\.body"):
        replace(tiny, look=replace(tiny.look, body="anything"))
