"""A camera as a source of frames: always the newest one, what came between is dropped and counted.

A thread takes every picture the moment the camera has it and keeps the last; the tracker asks for
one that it has not seen. So what is tracked is never older than one frame, however slow tracking
is. A frame's number counts what the camera sent, dropped ones too, and ``time_s`` is when it came.
"""

import sys
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np

from handtrack.errors import InputError
from handtrack.evidence.orientation import Image, Orientation
from handtrack.evidence.video import VideoInfo
from handtrack.output.provenance import Counts
from handtrack.records import Frame

#: How long the first picture, and any later one, may take.
FIRST_S, STALL_S = 10.0, 5.0
#: Unit of the time stamps in films of a camera.
TIME_BASE = Fraction(1, 90_000)


class Capture(Protocol):
    """What is needed of ``cv2.VideoCapture``."""

    def read(self) -> tuple[bool, Any]:
        """Wait for the next picture, BGR."""
        ...

    def get(self, prop: int, /) -> float:
        """A property; 0 if it is not known."""
        ...

    def release(self) -> None:
        """Give the camera back."""
        ...


@dataclass
class LiveCounts(Counts):
    """Counts of a camera, which also has frames that nobody looked at."""

    dropped: int = 0

    @property
    def sentence(self) -> str:
        """The counts for people."""
        return (
            f"camera sent {self.decoded + self.dropped}, dropped {self.dropped}, "
            f"tracked {self.tracked} (predicted {self.predicted}, lost {self.lost})"
        )


def is_camera(clip: Path) -> bool:
    """Whether a camera is meant: a number that is no file, or a device such as /dev/video0."""
    return clip.is_char_device() or (str(clip).isdecimal() and not clip.exists())


def open_capture(clip: Path) -> Capture:
    """The camera of this number or device.

    Raises
    ------
    InputError
        It cannot be opened.
    """
    with _silent_opencv():
        capture = (
            cv2.VideoCapture(int(str(clip)))
            if str(clip).isdecimal()
            else cv2.VideoCapture(str(clip), cv2.CAP_V4L2)
        )
    if not capture.isOpened():
        raise InputError(f"camera {clip}: cannot be opened ({_what_is_there()})")
    return capture


class Camera:
    """Takes pictures until it is closed.

    Parameters
    ----------
    name : str
        For people.
    capture : Capture
    max_minutes : float
        The frames end there.

    Raises
    ------
    InputError
        No picture comes.
    """

    def __init__(self, name: str, capture: Capture, max_minutes: float) -> None:
        self.name, self._capture, self._max_s = name, capture, 60 * max_minutes
        self.counts = LiveCounts()
        self._news = threading.Condition()
        self._newest: tuple[int, float, Image] | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._take, name="camera", daemon=True)
        self._thread.start()
        try:
            _, _, image = self._after(-1, FIRST_S)
        except InputError:
            self.close()
            raise
        self.info = _info(name, capture, image)

    def frames(self) -> Generator[Frame, None, None]:
        """The frames from now on, each the newest when it is asked for.

        Raises
        ------
        InputError
            The camera stopped sending.
        """
        first, begin_s, image = self._after(-1, STALL_S)
        index, time_s, last = first, begin_s, first - 1
        while time_s - begin_s <= self._max_s:
            self.counts.dropped += index - last - 1
            rgb = np.ascontiguousarray(image[:, :, ::-1])
            yield Frame(index - first, time_s - begin_s, rgb)
            last = index
            index, time_s, image = self._after(last, STALL_S)

    def close(self) -> None:
        """Give the camera back; one that hangs in its driver is left to the system."""
        with self._news:
            self._closed = True
        self._thread.join(timeout=2.0)
        if not self._thread.is_alive():
            self._capture.release()

    def _take(self) -> None:
        index = 0
        while not self._closed:
            ok, image = self._capture.read()
            if not ok or image is None:
                time.sleep(0.01)  # cameras need a moment at first; one that is gone is noticed
                continue
            with self._news:
                self._newest = (index, time.monotonic(), image)
                self._news.notify_all()
            index += 1

    def _after(self, last: int, patience_s: float) -> tuple[int, float, Image]:
        """The newest picture, once it is newer than ``last``."""
        with self._news:
            came = self._news.wait_for(
                lambda: self._newest is not None and self._newest[0] > last, patience_s
            )
            if not came or self._newest is None:
                raise InputError(
                    f"camera {self.name}: no picture for {patience_s:g} s; is it plugged in, and "
                    "does another program use it?"
                )
            return self._newest


def _info(name: str, capture: Capture, image: Image) -> VideoInfo:
    height_px, width_px = image.shape[:2]
    return VideoInfo(
        path=Path(f"camera {name}"),
        width_px=width_px,
        height_px=height_px,
        stored_width_px=width_px,
        stored_height_px=height_px,
        sample_aspect_ratio=Fraction(1),
        orientation=Orientation(),
        time_base=TIME_BASE,
        rate_hz=capture.get(cv2.CAP_PROP_FPS) or None,
        n_claimed=None,
        duration_s=None,
        codec="live",
        pixel_format="bgr24",
        has_audio=False,
    )


def _what_is_there() -> str:
    """The cameras that the system shows."""
    if not sys.platform.startswith("linux"):
        return "is it plugged in, and may this program use it?"
    devices = sorted(str(path) for path in Path("/dev").glob("video*"))
    return f"there are {', '.join(devices)}" if devices else "this machine has no /dev/video*"


@contextmanager
def _silent_opencv() -> Iterator[None]:
    """OpenCV's own lines on stderr would stand beside ours."""
    logging: Any = cv2.utils.logging
    before = logging.getLogLevel()
    logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        logging.setLogLevel(before)
