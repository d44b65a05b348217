import numpy as np
import pytest

from handtrack.camera import Window
from handtrack.evidence.background import Background, shrink, smooth_backdrop


def scene(seed=0, shape=(120, 160)):
    rng = np.random.default_rng(seed)
    blocks = rng.uniform(30, 220, (shape[0] // 20, shape[1] // 20, 3))
    return np.repeat(np.repeat(blocks, 20, axis=0), 20, axis=1)


def noisy(picture, seed):
    noise = np.random.default_rng(seed).normal(0, 2, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def test_learns_only_where_the_hand_is_not():
    background, hand = Background(), np.zeros((120, 160), bool)
    hand[40:80, 60:100] = True
    for k in range(10):
        background.watch(noisy(scene(), k), hand)
    assert not background.known[40:80, 60:100].any()
    far = np.ones((120, 160), bool)
    far[30:90, 50:110] = False
    assert background.known[far].all()
    assert np.abs(background.mean - scene())[far].mean() < 1


def test_window_shows_the_same_place():
    background = Background()
    for k in range(8):
        background.watch(noisy(scene(), k))
    window = Window(x_px=20.0, y_px=40.0, scale=0.5, width_px=40, height_px=30)
    local = background.through(window)
    x, y = window.to_frame(np.array([[12.0, 12.0], [30.0, 21.0]])).T
    want = scene()[y.astype(int), x.astype(int)]
    assert np.abs(local[[12, 21], [12, 30], :3] - want).max() < 3
    assert (local[..., 3] < 20).all()
    outside = background.through(Window(-500.0, 0.0, 1.0, 10, 10))
    assert (outside[..., 3] > 1e3).all()


def test_a_moved_camera_is_noticed_and_new_exposure_is_not_a_move():
    background = Background()
    for k in range(8):
        background.watch(noisy(scene(0), k))
    background.watch(noisy(scene(0) * 0.85, 20))
    assert background.known.all()
    background.watch(noisy(scene(1), 30))
    assert not background.known.any()


def test_a_change_of_the_light_is_followed_channel_by_channel_and_the_hand_need_not_be_masked():
    background, light = Background(), np.array([1.2, 1.0, 0.8])
    background.watch(noisy(scene(), 0))
    for k, share in enumerate(np.linspace(0, 1, 12)):
        frame = noisy(scene() * light**share, 1 + k)
        frame[40:100, 60:120] = (210, 150, 130)
        background.relight(frame)
    assert background.light == pytest.approx(light, abs=0.03)
    assert np.abs(background.mean - scene() * background.light).mean() < 2


@pytest.mark.parametrize("move", [(0, 30), (17, 0)])
def test_a_camera_that_pans_is_no_change_of_the_light(move):
    background = Background()
    background.watch(noisy(scene(), 0))
    background.relight(noisy(np.roll(scene(), move, axis=(0, 1)), 1))
    np.testing.assert_array_equal(background.light, 1)


def test_light_is_not_told_where_channels_are_clipped_or_frames_change_their_size():
    background, white = Background(), np.full((120, 160, 3), 255, np.uint8)
    background.watch(white)
    background.relight((white * 0.9).astype(np.uint8))
    background.relight(np.zeros((240, 320, 3), np.uint8))
    np.testing.assert_array_equal(background.light, 1)


def test_forgets_and_tells_differences():
    background = Background()
    for k in range(8):
        background.watch(noisy(scene(), k))
    frame = noisy(scene(), 40)
    frame[50:70, 70:90] = (250, 10, 240)
    d = background.difference(frame)
    assert d[50:70, 70:90].min() > 5
    assert np.quantile(d[:40], 0.99) < 3
    hand = np.zeros((120, 160), bool)
    hand[:, :100] = True
    background.forget(hand)
    assert background.difference(frame) is None  # most of it is not known any more
    assert Background().difference(frame) is None


@pytest.mark.parametrize("seed", range(4))
def test_backdrop_is_a_quadratic_seen_at_the_border(seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:120j, -1:1:160j]
    a = rng.uniform(-25, 25, (5, 3))
    truth = 128 + sum(t[..., None] * c for t, c in zip((x, y, x * y, x * x, y * y), a, strict=True))
    frame = truth + rng.normal(0, 2, truth.shape)
    frame[40:, 60:100] = (210, 150, 130)  # an arm that crosses the border
    backdrop, sigma = smooth_backdrop(np.clip(frame, 0, 255).astype(np.uint8))
    assert np.abs(backdrop - np.clip(truth, 0, 255)).mean() < 1.5
    assert sigma < 5


def test_backdrop_says_when_there_is_none():
    assert smooth_backdrop(scene().astype(np.uint8))[1] > 20


def test_shrink_keeps_the_mean_and_small_pictures():
    picture = scene(3, (400, 600)).astype(np.uint8)
    small = shrink(picture, 150)
    assert small.shape == (100, 150, 3)
    assert np.abs(small.mean(axis=(0, 1)) - picture.mean(axis=(0, 1))).max() < 2
    assert shrink(small, 150) is small
    assert max(shrink(np.zeros((2160, 3840, 3), np.uint8), 160).shape) == 160
