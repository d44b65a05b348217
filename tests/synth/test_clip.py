"""Scenes in, clips and truth out: the same bytes, the right pixels."""

from dataclasses import asdict, replace

import av
import numpy as np
import pytest
import tomli_w

from handtrack.camera import Camera
from handtrack.errors import InputError, OutputError
from handtrack.hand.shape import HandShape
from synth.actor import make_actor
from synth.background import KINDS, background
from synth.clip import Truth, frames, write_clip
from synth.light import lamps
from synth.scene import Scene, scene_names


def read(path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.array([f.to_ndarray(format="rgb24") for f in container.decode(video=0)])


@pytest.mark.parametrize("surface", ["smooth", "cardboard", "spheres"])
def test_the_same_scene_gives_the_same_bytes(tiny: Scene, surface, tmp_path, request) -> None:
    if surface == "smooth":
        request.getfixturevalue("gl")
    scene = replace(tiny, surface=surface, hand="any")
    write_clip(scene, tmp_path / "a")
    write_clip(scene, tmp_path / "b")
    for name in ("clip.mp4", "shape.toml", "camera.toml", "scene.toml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    a, b = Truth.load(tmp_path / "a/truth.npz"), Truth.load(tmp_path / "b/truth.npz")
    assert (a.theta == b.theta).all()
    assert (a.mask == b.mask).all()
    write_clip(replace(scene, seed=6), tmp_path / "c")
    assert (tmp_path / "a/clip.mp4").read_bytes() != (tmp_path / "c/clip.mp4").read_bytes()


@pytest.mark.parametrize("width_px", [240, 256, 322])
def test_a_film_does_not_depend_on_what_memory_held(cardboard: Scene, width_px, tmp_path) -> None:
    scene = replace(cardboard, width_px=width_px, height_px=180, focal_px=225.0)
    scene = replace(scene, motion=replace(scene.motion, frames=10))
    rng = np.random.default_rng(0)
    films = set()
    for k in range(8):
        used = [rng.integers(0, 255, n, np.uint8) for n in rng.integers(1000, 400_000, 20)]
        del used
        write_clip(scene, tmp_path / f"{k}")
        films.add((tmp_path / f"{k}" / "clip.mp4").read_bytes())
    assert len(films) == 1


def test_what_lies_beside_a_clip(cardboard: Scene, tmp_path) -> None:
    said = write_clip(cardboard, tmp_path)
    truth = Truth.load(tmp_path / "truth.npz")
    assert read(tmp_path / "clip.mp4").shape == (4, 120, 160, 3)
    assert truth.theta.shape == (4, 20)
    assert truth.R.shape == (4, 3, 3)
    assert truth.keypoints_mm.shape == (4, 21, 3)
    assert (truth.keypoints_px == said.keypoints_px).all()
    assert truth.side == "right"
    assert truth.fps == 30.0
    assert Camera.load(tmp_path / "camera.toml") == truth.camera == cardboard.camera
    assert HandShape.load(tmp_path / "shape.toml").calibrated
    assert Scene.load(tmp_path / "scene.toml") == cardboard
    assert np.allclose(truth.camera.project(truth.keypoints_mm), truth.keypoints_px)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("surface", ["smooth", "cardboard", "spheres"])
def test_keypoints_lie_on_the_hand_in_the_image(tiny, surface, side, tmp_path, request) -> None:
    if surface == "smooth":
        request.getfixturevalue("gl")
    truth = write_clip(replace(tiny, surface=surface, side=side), tmp_path)
    mask = np.unpackbits(truth.mask, axis=-1)[..., :160].astype(bool)
    px = np.round(truth.keypoints_px).astype(int)
    joints = [k for k in range(21) if k not in (4, 8, 12, 16, 20)]
    on = [mask[f, px[f, k, 1], px[f, k, 0]] for f in range(4) for k in joints]
    assert all(on)
    tips = truth.keypoints_px[0, [8, 12]]
    rows = np.flatnonzero(mask[0].any(axis=1))
    assert abs(tips[:, 1].min() - rows[0]) < 2.0  # the highest tip is the top of the mask
    thumb_right = truth.keypoints_px[0, 4, 0] > truth.keypoints_px[0, 20, 0]
    assert thumb_right == (side == "right")


def test_pixels_are_where_the_camera_says(gl) -> None:
    """A small square about a point is drawn about that point's projection."""
    from synth.render import Renderer

    camera = Camera(200.0, 210.0, 70.3, 61.8, 160, 120)
    point = np.array([13.0, -7.0, 300.0])
    corners = point + np.array([[-6, -6, 0], [6, -6, 0], [6, 6, 0], [-6, 6, 0.0]])
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
    with Renderer(camera) as renderer:
        alpha = renderer.draw(corners, faces, np.ones((4, 4)))[..., 3].astype(float)
    y, x = np.mgrid[0:120, 0:160]
    centre = np.array([(x * alpha).sum(), (y * alpha).sum()]) / alpha.sum()
    assert centre == pytest.approx(camera.project(point), abs=0.1)


def test_a_hand_out_of_the_image_is_not_there(gl, tiny: Scene) -> None:
    motion = replace(tiny.motion, frames=12, away=(0.4, 0.8))
    scene = replace(tiny, motion=motion)
    with make_actor(scene) as actor:
        share = [mask.mean() for _, mask in frames(scene, actor)]
    assert share[0] > 0.05
    assert min(share) == 0.0


@pytest.mark.parametrize("surface", ["smooth", "spheres"])
def test_a_sleeve_is_not_skin(gl, tiny: Scene, surface) -> None:
    def skin(forearm: str) -> float:
        look = replace(tiny.look, forearm=forearm)
        scene = replace(tiny, look=look, surface=surface)
        scene = replace(scene, motion=replace(scene.motion, frames=1, centre_mm=(0.0, -60.0)))
        with make_actor(scene) as actor:
            return float(next(iter(frames(scene, actor)))[1].mean())

    assert skin("sleeve") < 0.9 * skin("bare")


def test_blur_is_an_average_over_the_shutter(cardboard: Scene) -> None:
    fast = replace(cardboard.motion, speed=8.0, move_mm=(150.0, 0.0, 0.0), frames=12)
    sharp = replace(cardboard, motion=fast, look=replace(cardboard.look, noise=0.0))
    blurred = replace(sharp, look=replace(sharp.look, subframes=8, shutter=1.0))

    def edges(scene: Scene) -> float:
        with make_actor(scene) as actor:
            images = [image.astype(float) for image, _ in frames(scene, actor)]
        return float(np.mean([np.abs(np.diff(image, axis=1)).max() for image in images[4:]]))

    assert edges(blurred) < 0.85 * edges(sharp)


@pytest.mark.parametrize("kind", KINDS)
def test_backgrounds_are_images(kind: str) -> None:
    image = background(kind, 80, 60, np.random.default_rng(0))
    assert image.shape == (60, 80, 3)
    assert 0 <= image.min() <= image.max() <= 255
    again = background(kind, 80, 60, np.random.default_rng(0))
    assert (image == again).all()


def test_a_background_of_the_users(tmp_path) -> None:
    import cv2

    path = tmp_path / "büro 1.png"
    cv2.imwrite(str(path), np.full((30, 40, 3), (10, 20, 200), np.uint8))
    image = background(str(path), 20, 10, np.random.default_rng(0))
    assert image[0, 0].tolist() == [200, 20, 10]
    with pytest.raises(InputError, match="nor a readable image"):
        background(str(tmp_path / "no.png"), 20, 10, np.random.default_rng(0))


def test_every_ready_scene_can_be_read() -> None:
    names = scene_names()
    assert len(names) >= 9
    assert len({Scene.named(name) for name in names}) == len(names)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sede = 3", "unknown key sede"),
        ("[motion]\ntilt = 3", "unknown key tilt"),
        ("seed = 1.5", "wanted int"),
        ("side = 'both'", "'both' is not one of"),
        ("[motion]\nmove_mm = [1, 2]", "wanted a list of 3"),
        ("[look]\nlights = [{kind = 'laser'}]", "'laser' is not one of"),
        ("hand = 'paw'", "no hand named 'paw'"),
        ("[look]\nskin = 'blue'", "no skin tone 'blue'"),
        ("[motion]\nframes = 0", "frames"),
        ("width_px = 641", "even"),
        ("seed = ", "not a TOML file"),
    ],
)
def test_bad_scenes_are_refused_in_one_line(tmp_path, text: str, said: str) -> None:
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        write_clip(Scene.load(tmp_path / "s.toml"), tmp_path / "out")
    assert not (tmp_path / "out" / "clip.mp4").exists()


def test_scenes_round_trip(tmp_path) -> None:
    scene = Scene.named("clutter")
    (tmp_path / "s.toml").write_text(tomli_w.dumps(asdict(scene)))
    assert Scene.load(tmp_path / "s.toml") == scene


def test_a_folder_that_cannot_be_made(cardboard: Scene, tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot make the folder"):
        write_clip(cardboard, tmp_path / "file" / "out")


def test_what_is_any_is_decided_by_the_seed(tiny: Scene) -> None:
    look = replace(tiny.look, forearm="any", background="any", lights=())
    scene = replace(tiny, side="any", look=look, motion=replace(tiny.motion, facing="any"))
    made = [replace(scene, seed=seed).settled() for seed in range(40)]
    assert {s.side for s in made} == {"right", "left"}
    assert {s.look.forearm for s in made} == {"bare", "sleeve"}
    assert {s.look.background for s in made} == set(KINDS)
    backs = sum(s.motion.facing == "back" for s in made)
    assert 0 < backs < 20
    assert made[3] == replace(scene, seed=3).settled()
    assert lamps(scene.look, 1) == lamps(scene.look, 1) != lamps(scene.look, 2)
    assert lamps(tiny.look, 1) == (tiny.look.lights, tiny.look.ambient)
