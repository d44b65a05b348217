"""What networks learn from, as far as it needs neither PyTorch nor OpenGL."""

import cv2
import numpy as np
import pytest

from handtrack.bench.training.grounds import SIDE_PX, ground, photographs, some_shape
from handtrack.bench.training.scenes import scene_from
from handtrack.bench.training.skin import as_skin
from handtrack.errors import InputError
from synth.pictures import PALM_PX, Picture
from synth.pictures import SIDE_PX as PICTURE_PX


@pytest.fixture(scope="module")
def fist():
    """A picture of a disc with an arm below, upright."""
    alpha = np.zeros((PICTURE_PX, PICTURE_PX), np.uint8)
    cv2.circle(alpha, (72, 60), 24, 255, -1)
    cv2.rectangle(alpha, (60, 60), (84, PICTURE_PX), 255, -1)
    R = np.diag([1.0, -1.0, -1.0])
    return Picture(alpha // 2, alpha, np.zeros(20), R, np.array([72.0, 60.0]), 400.0)


@pytest.fixture(scope="module")
def grounds():
    rng = np.random.default_rng(0)
    return [ground([], [], rng) for _ in range(12)]


def scenes(fist, grounds, seed, count=60):
    rng = np.random.default_rng(seed)
    return [scene_from([fist], grounds, rng) for _ in range(count)]


def test_scenes_show_hands_of_every_size_and_sometimes_none(fist, grounds):
    share = np.array([s.skin.mean() for s in scenes(fist, grounds, 1)])
    assert all(s.seen.shape == (SIDE_PX, SIDE_PX, 3) for s in scenes(fist, grounds, 1, 3))
    assert 1 <= (share == 0).sum() < 20
    assert share[share > 0].min() < 0.04
    assert share.max() > 0.3


def test_same_seed_same_scenes(fist, grounds):
    for one, other in zip(scenes(fist, grounds, 7, 5), scenes(fist, grounds, 7, 5), strict=True):
        np.testing.assert_array_equal(one.seen, other.seen)
        np.testing.assert_array_equal(one.skin, other.skin)


def test_skin_differs_from_what_is_behind_it_where_that_is_black(fist):
    black = [np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)]
    told = []
    for s in scenes(fist, black, 3):
        inside, outside = s.skin > 0.9, s.skin < 0.1
        if inside.sum() > 100:
            told.append(s.seen[inside].mean() - s.seen[outside].mean())
    assert np.median(told) > 30


def test_sleeves_are_no_skin(fist, grounds):
    """The arm leaves through the border of the scene in some scenes and not in others."""
    bare = [s.skin[-1].max() > 0.5 for s in scenes(fist, grounds, 5) if s.skin.max() > 0.5]
    assert 0.1 < np.mean(bare) < 0.9


def test_palms_are_as_long_as_stated(fist, grounds):
    """A disc of 24 px for a palm of PALM_PX covers at least what the smallest palm covers."""
    areas = [(s.skin > 0.5).sum() for s in scenes(fist, grounds, 9, 200) if s.skin.max() > 0.5]
    smallest = np.pi * (24 * 14 / PALM_PX) ** 2
    assert np.quantile(areas, 0.2) > 0.8 * smallest


def test_grounds_and_shapes_differ():
    rng = np.random.default_rng(2)
    assert len({ground([], [], rng).tobytes() for _ in range(10)}) == 10
    assert len({some_shape(rng).tobytes() for _ in range(10)}) > 5


def test_photographs_are_used_and_a_folder_without_any_is_named(tmp_path):
    with pytest.raises(InputError, match="no images"):
        photographs(tmp_path)
    red = np.zeros((200, 300, 3), np.uint8)
    red[..., 2] = 255
    cv2.imwrite(str(tmp_path / "red.png"), red)
    (photo,) = photographs(tmp_path)
    assert photo[0, 0].tolist() == [255, 0, 0]
    rng = np.random.default_rng(4)
    reds = [
        (ground([photo], [], rng).reshape(-1, 3) == [255, 0, 0]).all(-1).mean() for _ in range(40)
    ]
    assert np.mean(np.array(reds) > 0.5) > 0.15


def test_people_may_stand_behind():
    person = np.zeros((200, 150, 3), np.uint8) + np.array([200, 150, 120], np.uint8)
    rng = np.random.default_rng(4)
    drawn = [ground([], [person], rng) for _ in range(60)]
    share = np.mean([(image == image[0, 0]).all() for image in drawn])
    assert 0.25 < share < 0.6  # plain textures are among the others


def test_hands_have_the_colour_of_what_is_behind_now_and_then(fist):
    green = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8) + np.array([40, 200, 60], np.uint8)
    rng = np.random.default_rng(2)
    greener = []
    for _ in range(200):
        scene = scene_from([fist], [green], rng)
        if (inside := scene.skin > 0.9).sum() > 100:
            r, g, _ = scene.seen[inside].mean(axis=0)
            greener.append(g > 1.5 * r)
    assert 0.1 < np.mean(greener) < 0.4


def test_skin_is_uneven_where_a_render_is_smooth_and_as_bright_as_it_on_the_whole():
    rng = np.random.default_rng(4)
    even = np.full((SIDE_PX, SIDE_PX, 3), 120, np.uint8)
    factors = [as_skin(40.0, even, rng) for _ in range(80)]
    spread = np.array([np.log(f[..., 1]).std() for f in factors])
    assert 0.05 < np.mean(spread == 0) < 0.5  # some stay smooth
    assert np.median(spread) > 0.03
    assert 0.6 < np.median([f.mean() for f in factors]) < 1.2


def test_skin_takes_the_grain_of_a_picture():
    """Factors are brighter where the picture is, seen finely, if its grain is taken at all."""
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX]
    chequered = np.repeat((255 * ((x // 2 + y // 2) % 2))[..., None], 3, axis=-1).astype(np.uint8)
    rng = np.random.default_rng(5)
    alike = []
    for _ in range(60):
        factors = as_skin(40.0, chequered, rng)[..., 1]
        alike.append(factors[chequered[..., 0] > 0].mean() / factors[chequered[..., 0] == 0].mean())
    assert min(alike) > 0.9
    assert 0.2 < np.mean(np.array(alike) > 1.15) < 0.6
