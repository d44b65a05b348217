"""The overlay film: time stamps, a size that encodes, sound, and what is drawn where."""

from fractions import Fraction

import av
import numpy as np
import pytest

from handtrack.errors import OutputError
from handtrack.evidence.video import probe, read_frames
from handtrack.output.drawing import DIGIT_COLOURS, STATUS_COLOURS, draw_result
from handtrack.output.overlay import OverlayWriter
from handtrack.records import FrameResult, Status


def write(path, times_s, size=(64, 48), sound_of=None, time_base=Fraction(1, 1000)):
    overlay = OverlayWriter(path, *size, time_base, sound_of)
    for k, time_s in enumerate(times_s):
        overlay.add(time_s, lambda k=k: np.full((size[1], size[0], 3), 20 * k % 256, np.uint8))
    overlay.finish()
    return path


def test_time_stamps_are_kept(tmp_path):
    times_s = [0.0, 0.033, 0.034, 0.5, 0.54, 2.0]
    frames = list(read_frames(write(tmp_path / "Ä overlay.mp4", times_s)))
    assert [f.time_s for f in frames] == pytest.approx(times_s, abs=1e-6)
    assert [int(f.image.mean()) for f in frames] == pytest.approx([0, 20, 40, 60, 80, 100], abs=4)
    assert [p.name for p in tmp_path.iterdir()] == ["Ä overlay.mp4"]


def test_equal_time_stamps_do_not_stop_it(tmp_path):
    frames = list(read_frames(write(tmp_path / "o.mp4", [0.0, 0.04, 0.04, 0.02, 0.1])))
    assert len(frames) == 5


def test_any_player_opens_it(tmp_path):
    info = probe(write(tmp_path / "o.mp4", [0.0, 0.1], size=(63, 47)))
    assert (info.codec, info.pixel_format) == ("h264", "yuv420p")
    assert (info.width_px, info.height_px) == (64, 48)


def test_sound_is_copied(tmp_path, write_clip):
    clip = write_clip(tmp_path / "clip.mp4", n=50, audio=True)
    path = write(tmp_path / "o.mp4", [0.04 * k for k in range(50)], sound_of=clip)

    def sound(path):
        with av.open(str(path)) as container:
            packets = [p for p in container.demux(audio=0) if p.dts is not None]
            return [bytes(p) for p in packets], [float(p.pts * p.time_base) for p in packets]

    (data, times_s), (wanted, wanted_s) = sound(path), sound(clip)
    assert len(data) > 10
    assert data == wanted[: len(data)]
    assert times_s == pytest.approx(wanted_s[: len(times_s)], abs=1e-3)
    assert times_s[-1] > 1.75


def test_nothing_is_there_before_the_end_or_after_discarding(tmp_path):
    overlay = OverlayWriter(tmp_path / "o.mp4", 64, 48, Fraction(1, 25))
    overlay.add(0.0, lambda: np.zeros((48, 64, 3), np.uint8))
    assert not (tmp_path / "o.mp4").exists()
    overlay.discard()
    assert list(tmp_path.iterdir()) == []


def test_no_frames_at_all(tmp_path):
    write(tmp_path / "o.mp4", [])
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_not_there(tmp_path):
    with pytest.raises(OutputError, match=r"o\.mp4: cannot be written"):
        write(tmp_path / "none" / "o.mp4", [0.1 * k for k in range(20)])


def test_fault_while_drawing_comes_out(tmp_path):
    overlay = OverlayWriter(tmp_path / "o.mp4", 64, 48, Fraction(1, 25))
    overlay.add(0.0, lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        overlay.finish()
    assert list(tmp_path.iterdir()) == []


def result(status=Status.TRACKED, points=None):
    unknown = FrameResult.unknown(3, 0.1, status, "left")
    if points is None:
        return unknown
    return FrameResult(**vars(unknown) | {"keypoints_px": points})


def test_bones_are_drawn_in_the_colour_of_their_digit():
    points = np.full((21, 2), [50.0, 180.0])
    for k in range(1, 21):
        points[k] = 30 + 40 * ((k - 1) // 4), 150 - 30 * ((k - 1) % 4)
    image = np.full((200, 230, 3), 128, np.uint8)
    draw_result(image, result(points=points))
    for digit, colour in enumerate(DIGIT_COLOURS):
        between = (points[1 + 4 * digit] + points[2 + 4 * digit]) / 2
        x, y = between.astype(int)
        np.testing.assert_array_equal(image[y, x], colour)


def test_outline_is_drawn_where_it_is():
    image = np.full((200, 200, 3), 128, np.uint8)
    draw_result(image, result(), [np.array([[50.0, 60.0], [150.0, 60.0], [150.0, 160.0]])])
    assert image[60, 100].tolist() == [255, 255, 255]
    assert image[110, 150].tolist() == [255, 255, 255]
    assert image[120, 90].tolist() == [128, 128, 128]


@pytest.mark.parametrize("status", list(Status))
def test_status_shows_on_the_bar(status):
    image = np.full((100, 300, 3), 128, np.uint8)
    draw_result(image, result(status))
    assert image[1, -2].tolist() == list(STATUS_COLOURS[status])
    assert (image[50:] == 128).all()


@pytest.mark.parametrize("far", [1e9, -1e9, np.nan, np.inf])
def test_points_far_outside_do_no_harm(far):
    points = np.full((21, 2), 50.0)
    points[8] = far
    image = np.zeros((100, 100, 3), np.uint8)
    draw_result(image, result(points=points), [points])


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (17, 9)])
def test_tiny_pictures(size, tmp_path):
    def draw():
        image = np.zeros((size[1], size[0], 3), np.uint8)
        draw_result(image, result(points=np.zeros((21, 2))))
        return image

    overlay = OverlayWriter(tmp_path / "o.mp4", *size, Fraction(1, 25))
    overlay.add(0.0, draw)
    overlay.finish()
    assert len(list(read_frames(tmp_path / "o.mp4"))) == 1
