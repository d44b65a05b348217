"""A camera that is played: the newest frame, honest counts, its picture on a page, a clean end."""

import csv
import http.client
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import handtrack
from handtrack import cli
from handtrack.errors import InputError
from handtrack.evidence.video import read_frames
from handtrack.live import camera as live
from handtrack.live.page import HOST, Page
from handtrack.output.provenance import read_provenance
from synth.clip import write_clip
from synth.scene import Scene


class Played:
    """Has the interface of ``cv2.VideoCapture`` and plays images at a rate, then nothing."""

    def __init__(self, images, rate_hz, n=None):
        self.images, self.rate_hz, self.n = images, rate_hz, n
        self.begin_s, self.times_s, self.released = time.monotonic(), [], False

    def read(self):
        k = len(self.times_s)
        if self.n is not None and k >= self.n:
            return False, None
        time.sleep(max(0.0, self.begin_s + k / self.rate_hz - time.monotonic()))
        self.times_s.append(time.monotonic())
        return True, self.images[k % len(self.images)]

    def get(self, prop):
        return self.rate_hz if prop == cv2.CAP_PROP_FPS else 0.0

    def release(self):
        self.released = True


def numbered(n):
    """Small pictures of which each is as bright as its number."""
    return [np.full((8, 8, 3), k, np.uint8) for k in range(n)]


def test_slow_tracking_gets_the_newest_frame_and_counts_the_others():
    capture = Played(numbered(250), rate_hz=100)
    camera = live.Camera("0", capture, max_minutes=1)
    frames, ages, shown, seen = camera.frames(), [], [], []
    for frame in frames:
        time_s = time.monotonic()
        number = int(frame.image[0, 0, 0])
        shown.append(number)
        seen.append(frame)
        ages.append(time_s - capture.times_s[number])
        if len(seen) == 12:
            break
        time.sleep(0.05)
    frames.close()
    camera.close()
    assert capture.released
    index = np.array([frame.index for frame in seen])
    assert index.tolist() == (np.array(shown) - shown[0]).tolist()
    assert camera.counts.dropped == index[-1] + 1 - len(seen)
    assert camera.counts.dropped > 20  # 12 of about 56
    came_s = np.array(capture.times_s)[shown]
    # a time stamp is when the picture came, not when it was looked at
    np.testing.assert_allclose([f.time_s for f in seen], came_s - came_s[0], atol=0.02)
    assert np.median(ages) < 0.02  # it may be one frame old, and never waits in a queue


def test_quick_tracking_drops_nothing_and_channels_are_in_our_order():
    blue = np.zeros((8, 10, 3), np.uint8)
    blue[:, :, 0] = 200  # cameras send BGR
    camera = live.Camera("0", Played([blue], rate_hz=20), max_minutes=0.6 / 60)
    frames = list(camera.frames())
    camera.close()
    assert len(frames) >= 8
    assert [f.index for f in frames] == list(range(len(frames)))
    assert camera.counts.dropped == 0
    assert frames[0].image[0, 0].tolist() == [0, 0, 200]
    assert frames[-1].time_s <= 0.6
    assert (camera.info.width_px, camera.info.height_px, camera.info.rate_hz) == (10, 8, 20)


def test_camera_that_stops_or_never_begins_is_one_line(monkeypatch):
    monkeypatch.setattr(live, "STALL_S", 0.2)
    monkeypatch.setattr(live, "FIRST_S", 0.2)
    camera = live.Camera("7", Played(numbered(9), 100, n=5), max_minutes=1)
    with pytest.raises(InputError, match=r"camera 7: no picture for 0\.2 s"):
        list(camera.frames())
    camera.close()
    dead = Played(numbered(9), 100, n=0)
    with pytest.raises(InputError, match="camera 8: no picture"):
        live.Camera("8", dead, max_minutes=1)
    assert dead.released


def test_number_means_a_camera_unless_there_is_such_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert live.is_camera(Path("0"))
    assert live.is_camera(Path("/dev/null"))
    assert not live.is_camera(Path("0.mp4"))
    Path("0").write_bytes(b"")
    assert not live.is_camera(Path("0"))
    with pytest.raises(InputError, match=r"camera 3: .*Tracker\.step"):
        handtrack.track("3")


@pytest.mark.skipif(Path("/dev/video0").exists(), reason="there is a camera here")
@pytest.mark.parametrize("name", ["0", "/dev/null"])
def test_missing_camera_is_one_line_and_leaves_nothing(name, tmp_path):
    command = [sys.executable, "-m", "handtrack", "run", name]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"handtrack: camera {name}: cannot be opened")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def ask(port, path, host=None):
    connection = http.client.HTTPConnection(HOST, port, timeout=10)
    connection.request("GET", path, headers={"Host": host} if host else {})
    return connection.getresponse()


def next_picture(response):
    """The next part of a stream, decoded as a browser does; None at its end."""
    while (line := response.readline()).strip() != b"--picture":
        if line.strip() == b"--picture--":
            return None
        assert line, "the stream broke off"
    head = {}
    while line := response.readline().strip():
        name, _, value = line.decode().partition(": ")
        head[name] = value
    assert head["Content-Type"] == "image/jpeg"
    data = np.frombuffer(response.read(int(head["Content-Length"])), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1]


@pytest.fixture
def page():
    page = Page(0)
    yield page, int(page.address.rstrip("/").rpartition(":")[2])
    page.close()


def test_page_streams_what_is_shown_to_everybody_who_looks(page):
    page, port = page
    red, green = (np.full((40, 60, 3), c, np.uint8) for c in ([200, 0, 0], [0, 200, 0]))
    page.show(red)
    both = [ask(port, "/stream.mjpg") for _ in range(2)]
    assert "multipart/x-mixed-replace" in both[0].getheader("Content-Type")
    for response in both:
        np.testing.assert_allclose(next_picture(response), np.int16(red), atol=4)
    both[1].close()  # one who leaves does not disturb the other
    page.show(green)
    np.testing.assert_allclose(next_picture(both[0]), np.int16(green), atol=4)
    page._newest.end()
    assert next_picture(both[0]) is None


def test_page_answers_this_machine_only(page):
    page, port = page
    assert page.address.startswith("http://127.0.0.1:")
    assert b'src="/stream.mjpg"' in ask(port, "/").read()
    assert ask(port, "/", host=f"localhost:{port}").status == 200
    assert ask(port, "/", host="evil.example").status == 403
    assert ask(port, "/run.json").status == 404
    with pytest.raises(InputError, match=f"--port {port}: cannot be had .*; 0 takes a free one"):
        Page(port)


@pytest.fixture(scope="module")
def hand_images(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    scene = Scene(seed=1, surface="cardboard", width_px=240, height_px=180, focal_px=225.0)
    write_clip(replace(scene, motion=replace(scene.motion, frames=60)), folder, progress=False)
    return [f.image[:, :, ::-1].copy() for f in read_frames(folder / "clip.mp4")]


def free_port():
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def watch_then_interrupt(port, pictures):
    """Look at the page like a browser, and press Ctrl-C after eight pictures."""
    try:
        end = time.monotonic() + 60
        while time.monotonic() < end:
            try:
                response = ask(port, "/stream.mjpg")
                break
            except ConnectionError:
                time.sleep(0.05)
        pictures += [next_picture(response) for _ in range(8)]
    finally:
        os.kill(os.getpid(), signal.SIGINT)


def test_run_of_a_camera_from_first_picture_to_ctrl_c(tmp_path, hand_images, monkeypatch, capsys):
    capture = Played(hand_images, rate_hz=60)
    monkeypatch.setattr("handtrack.source.open_capture", lambda clip: capture)
    port, pictures, out = free_port(), [], tmp_path / "out"
    watcher = threading.Thread(target=watch_then_interrupt, args=(port, pictures))
    watcher.start()
    assert cli.main(["run", "0", "--port", str(port), "--out", str(out)]) == 0
    watcher.join()
    assert capture.released
    said, err = capsys.readouterr()
    assert err == ""
    assert said.splitlines()[0].startswith(f"live picture at http://127.0.0.1:{port}/")
    assert len(pictures) == 8
    bars = [picture[2, -3].argmax() for picture in pictures]
    assert 1 in bars  # green: "tracked"
    counts = read_provenance(out)["counts"]
    with open(out / "angles.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    frames = [int(row["frame"]) for row in rows]
    assert len(rows) == counts["decoded"] >= 8
    assert frames == sorted(set(frames))
    assert counts["dropped"] == frames[-1] + 1 - len(rows)
    assert f"camera sent {frames[-1] + 1}, dropped {counts['dropped']}, tracked" in said
    assert sum(row["status"] == "tracked" for row in rows) == counts["tracked"] > 0
    film_s = [frame.time_s for frame in read_frames(out / "overlay.mp4")]
    np.testing.assert_allclose(film_s, [float(row["time_s"]) for row in rows], atol=1e-3)
    record = read_provenance(out)
    assert (record["state"], record["clip"]["name"]) == ("complete", "camera 0")


def test_unplugged_camera_keeps_what_was_tracked(tmp_path, hand_images, monkeypatch, capsys):
    monkeypatch.setattr(live, "STALL_S", 0.5)
    monkeypatch.setattr("handtrack.source.open_capture", lambda clip: Played(hand_images, 20, n=30))
    out = tmp_path / "out"
    assert cli.main(["run", "1", "--port", "0", "--no-overlay", "--out", str(out)]) == 2
    assert capsys.readouterr().err.startswith("handtrack: camera 1: no picture for 0.5 s")
    counts = read_provenance(out)["counts"]
    assert counts["decoded"] >= 1
    assert len((out / "angles.csv").read_text().splitlines()) == 1 + counts["decoded"]
