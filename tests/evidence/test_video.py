"""Clips as they come: shape, turns, time stamps, colours, and files that are not what they say."""

import threading
from fractions import Fraction

import av
import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.evidence.orientation import Orientation
from handtrack.evidence.video import Limits, probe, read_frames

LEVELS = 12  # what chroma subsampling and compression may change in flat colour, of 255

RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)


def corners(image):
    """Colours well inside the four quarters: top left, top right, bottom left, bottom right."""
    h, w = image.shape[:2]
    return image[[h // 8, h // 8, -h // 8, -h // 8], [w // 8, -w // 8, w // 8, -w // 8]].astype(int)


def assert_corners(image, *colours):
    np.testing.assert_allclose(corners(image), colours, atol=LEVELS)


def frames_of(path, **kwargs):
    return list(read_frames(path, **kwargs))


def test_plain_clip(tmp_path, write_clip):
    path = write_clip(tmp_path / "Händ clip #1.mp4", n=7)
    info = probe(path)
    assert (info.width_px, info.height_px, info.n_claimed) == (96, 64, 7)
    frames = frames_of(path)
    assert [f.index for f in frames] == list(range(7))
    assert [f.time_s for f in frames] == pytest.approx([0.04 * k for k in range(7)], abs=1e-9)
    for frame in frames:
        assert frame.image.shape == (64, 96, 3)
        assert frame.image.dtype == np.uint8
        assert_corners(frame.image, RED, GREEN, BLUE, WHITE)


def test_helper_notices_wrong_corners(tmp_path, write_clip):
    [frame] = frames_of(write_clip(tmp_path / "a.mp4", n=1))
    with pytest.raises(AssertionError):
        assert_corners(frame.image, GREEN, RED, BLUE, WHITE)


def test_variable_frame_rate_is_kept(tmp_path, write_clip):
    pts_ms = [0, 33, 34, 500, 540, 2000]
    frames = frames_of(write_clip(tmp_path / "vfr.mp4", n=6, pts_ms=pts_ms))
    assert [f.time_s for f in frames] == pytest.approx([t / 1000 for t in pts_ms], abs=1e-3)


def test_time_stamps_are_the_containers_own(tmp_path, write_clip):
    path = write_clip(tmp_path / "late.mkv", n=3, pts_ms=[7000, 7040, 7080])
    assert [f.time_s for f in frames_of(path)] == pytest.approx([7.0, 7.04, 7.08], abs=1e-9)


@pytest.mark.parametrize(
    ("aspect", "size"),
    [(Fraction(1, 3), (32, 64)), (Fraction(3, 2), (96, 43)), (Fraction(1), (96, 64))],
)
def test_sample_aspect_ratio_is_applied_once(aspect, size, tmp_path, write_clip):
    path = write_clip(tmp_path / "a.mp4", n=2, aspect=aspect)
    info = probe(path)
    assert (info.width_px, info.height_px) == size
    assert info.sample_aspect_ratio == aspect
    for frame in frames_of(path):
        assert frame.image.shape == (size[1], size[0], 3)
        assert_corners(frame.image, RED, GREEN, BLUE, WHITE)


@pytest.mark.parametrize(
    ("counterclockwise_deg", "clockwise_deg", "colours"),
    [
        (-90, 90, (BLUE, RED, WHITE, GREEN)),
        (90, 270, (GREEN, WHITE, RED, BLUE)),
        (180, 180, (WHITE, BLUE, GREEN, RED)),
    ],
)
def test_rotation_is_applied_once(
    counterclockwise_deg, clockwise_deg, colours, tmp_path, write_clip
):
    path = write_clip(tmp_path / "turned.mp4", n=2, rotate_deg=counterclockwise_deg)
    info = probe(path)
    assert info.orientation.clockwise_deg == clockwise_deg
    assert not info.orientation.mirrored
    for frame in frames_of(path):
        assert frame.image.shape == (info.height_px, info.width_px, 3)
        assert frame.image.flags.c_contiguous
        assert_corners(frame.image, *colours)


def test_mirror_image_is_turned_back(tmp_path, write_clip):
    path = write_clip(tmp_path / "selfie.mp4", n=1, mirror=True)
    assert probe(path).orientation.mirrored
    [frame] = frames_of(path)
    assert_corners(frame.image, GREEN, RED, WHITE, BLUE)


def test_rotation_comes_after_the_aspect_ratio(tmp_path, write_clip):
    path = write_clip(tmp_path / "both.mp4", n=1, aspect=Fraction(1, 2), rotate_deg=-90)
    [frame] = frames_of(path)
    assert frame.image.shape == (48, 64, 3)
    assert_corners(frame.image, BLUE, RED, WHITE, GREEN)


@pytest.mark.parametrize("transpose", [False, True])
@pytest.mark.parametrize("flip_x", [False, True])
@pytest.mark.parametrize("flip_y", [False, True])
def test_orientation_is_told_as_a_turn_then_a_flip(transpose, flip_x, flip_y):
    orientation = Orientation(transpose, flip_x, flip_y)
    image = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    turned = np.rot90(image, -orientation.clockwise_deg // 90)
    told = turned[:, ::-1] if orientation.mirrored else turned
    np.testing.assert_array_equal(orientation.apply(image), told)


@pytest.mark.parametrize(
    ("codec", "pixel_format", "suffix"),
    [
        ("libx264", "yuv420p10le", ".mp4"),
        ("libx264", "yuv444p", ".mp4"),
        ("libx264", "yuvj420p", ".mp4"),
        ("mjpeg", "yuvj422p", ".avi"),
        ("ffv1", "bgr0", ".mkv"),
    ],
)
def test_colours_of_other_pixel_formats(codec, pixel_format, suffix, tmp_path, write_clip):
    path = write_clip(tmp_path / f"a{suffix}", n=3, codec=codec, pixel_format=pixel_format)
    frames = frames_of(path)
    assert len(frames) == 3
    assert_corners(frames[-1].image, RED, GREEN, BLUE, WHITE)


@pytest.mark.parametrize("pixel_format", ["gray", "gray10le"])
def test_grey(pixel_format, tmp_path, write_clip):
    path = write_clip(tmp_path / "a.mkv", n=2, codec="ffv1", pixel_format=pixel_format)
    for frame in frames_of(path):
        assert frame.image.shape == (64, 96, 3)
        assert np.ptp(frame.image.astype(int), axis=2).max() == 0
        assert frame.image.max() > 240


def test_odd_size(tmp_path, write_clip):
    path = write_clip(tmp_path / "odd.mp4", n=2, size=(95, 63), pixel_format="yuv444p")
    assert [f.image.shape for f in frames_of(path)] == [(63, 95, 3)] * 2


def test_still_picture_is_a_clip_of_one_frame(tmp_path, write_clip):
    [frame] = frames_of(write_clip(tmp_path / "one.mp4", n=1))
    assert frame.time_s == 0.0


def test_truncated_file_keeps_what_decodes(tmp_path, write_clip):
    whole = write_clip(tmp_path / "whole.mp4", n=60)
    cut = tmp_path / "cut.mp4"
    data = whole.read_bytes()
    cut.write_bytes(data[: len(data) * 2 // 3])
    frames = frames_of(cut)
    decoded = [f for f in frames if f.image is not None]
    assert probe(cut).n_claimed == 60
    assert 5 < len(decoded) < 60
    assert [f.index for f in frames] == list(range(len(frames)))


def test_broken_packet_is_a_frame_without_an_image(tmp_path, write_clip):
    path = write_clip(tmp_path / "a.mp4", n=30)
    with av.open(str(path)) as container:
        packets = [p for p in container.demux(video=0) if p.pts is not None]
        start, stop, lost = packets[15].pos, packets[15].pos + packets[15].size, packets[15].pts
        position = sorted(p.pts for p in packets).index(lost)
    data = bytearray(path.read_bytes())
    data[start:stop] = bytes(stop - start)
    path.write_bytes(data)
    frames = frames_of(path)
    assert [f.image is None for f in frames] == [k == position for k in range(30)]
    assert [f.time_s for f in frames] == pytest.approx([0.04 * k for k in range(30)], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.mp4", b"", "is empty"),
        ("text.mp4", b"this is no video\n" * 50, "not a video that can be read"),
        ("noise.mp4", bytes(range(256)) * 40, "not a video that can be read"),
        ("http:host.mp4", b"", "is empty"),
    ],
)
def test_not_a_video(name, content, says, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        probe(path)
    assert name in str(error.value)


def test_missing_and_folder(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        probe(tmp_path / "none.mp4")
    with pytest.raises(InputError, match="is a folder"):
        probe(tmp_path)


def test_audio_only(tmp_path, write_clip):
    path = write_clip(tmp_path / "song.mp4", picture=False, audio=True)
    with pytest.raises(InputError, match="no moving picture in it, only audio"):
        probe(path)


def test_mp4_cut_before_its_index(tmp_path, write_clip):
    path = write_clip(tmp_path / "a.mp4", n=20, movflags="")
    path.write_bytes(path.read_bytes()[:-600])
    with pytest.raises(InputError, match="not a video that can be read"):
        probe(path)


def test_limits_are_checked_against_the_header(tmp_path, write_clip):
    path = write_clip(tmp_path / "a.mp4", n=5)
    with pytest.raises(InputError, match="--max-megapixels"):
        read_frames(path, Limits(max_megapixels=0.006))
    with pytest.raises(InputError, match="--max-minutes"):
        read_frames(path, Limits(max_minutes=0.1 / 60))
    assert len(frames_of(path, limits=Limits(max_megapixels=0.0062, max_minutes=0.21 / 60))) == 5


def test_leaving_early_stops_the_decoder(tmp_path, write_clip):
    before = threading.active_count()
    frames = read_frames(write_clip(tmp_path / "a.mp4", n=50))
    assert next(frames).index == 0
    frames.close()
    assert threading.active_count() == before


def test_real_clip_has_its_true_shape(shared):
    info = probe(shared / "clips" / "folding.mp4")
    assert (info.width_px, info.height_px, info.n_claimed) == (405, 720, 642)
    frames = read_frames(info.path, info=info)
    assert [next(frames).time_s for _ in range(3)] == pytest.approx([0, 1 / 30, 2 / 30], abs=1e-4)
    frames.close()
