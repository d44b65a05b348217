"""``overlay.mp4``: the clip with the hand drawn over it, drawn and encoded in a thread.

H.264 in ``yuv420p``, which players and browsers open; every frame keeps the input's own time
stamp; odd sizes are padded by one line of pixels; sound is copied, not encoded again, where the
container takes it. At most a few frames wait, so a slow encoder slows the caller and memory
stays bounded.
"""

import queue
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from av.audio.stream import AudioStream
from av.packet import Packet
from av.video.stream import VideoStream
from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.output.files import hidden_beside, put_in_place

Image = NDArray[np.uint8]

OVERLAY_MP4 = "overlay.mp4"
#: Frames that may wait for the encoder.
N_WAITING = 4
#: Sound that goes into an MP4 file as it is.
COPIED_SOUND = frozenset({"aac", "mp3", "ac3", "eac3", "opus", "alac", "flac"})
#: x264: quick, visually clean, no frame waits for a later one. Without the macroblock tree, which
#: takes in what lies in memory behind a row, so that the same pictures may become other bytes.
ENCODER_OPTIONS = {
    "preset": "veryfast",
    "crf": "21",
    "bf": "0",
    "x264-params": "ref=1:me=dia:subme=1:mbtree=0",
}


@dataclass(frozen=True)
class _Job:
    time_s: float
    draw: Callable[[], Image]


class OverlayWriter:
    """Encodes frames that are drawn when their turn comes.

    Parameters
    ----------
    path : Path
        Where the film goes; it appears there when it is finished.
    width_px, height_px : int
        Size of the frames.
    time_base : Fraction
        Unit of the time stamps in seconds.
    sound_of : Path, optional
        A clip whose sound is copied.

    Raises
    ------
    OutputError
        The file cannot be written; raised by the next call after it happened.
    """

    def __init__(
        self,
        path: Path,
        width_px: int,
        height_px: int,
        time_base: Fraction,
        sound_of: Path | None = None,
    ) -> None:
        self._path, self._part = path, hidden_beside(path)
        self._size, self._time_base, self._sound_of = (width_px, height_px), time_base, sound_of
        self._jobs: queue.Queue[_Job | None] = queue.Queue(maxsize=N_WAITING)
        self._error: Exception | None = None
        self._n = 0
        self._thread = threading.Thread(target=self._work, name="overlay", daemon=True)
        self._thread.start()

    def add(self, time_s: float, draw: Callable[[], Image]) -> None:
        """Queue a frame; ``draw()`` gives its picture ``(H, W, 3)`` in the encoder's thread."""
        self._raise_if_failed()
        self._jobs.put(_Job(time_s, draw))
        self._n += 1

    def finish(self) -> None:
        """Encode what waits, close the file and give it its name; without frames there is none."""
        self._close()
        try:
            self._raise_if_failed()
            if self._n:
                put_in_place(self._part, self._path)
        finally:
            self._part.unlink(missing_ok=True)

    def discard(self) -> None:
        """Leave nothing behind."""
        self._close()
        self._part.unlink(missing_ok=True)

    def _close(self) -> None:
        self._jobs.put(None)
        self._thread.join()

    def _raise_if_failed(self) -> None:
        if self._error is None:
            return
        if isinstance(self._error, av.error.FFmpegError | OSError):
            reason = self._error.strerror
            raise OutputError(f"{self._path}: cannot be written ({reason})") from self._error
        raise self._error

    def _work(self) -> None:
        try:
            self._encode()
        except Exception as error:
            self._error = error
            while self._jobs.get() is not None:
                pass  # nobody shall wait for a place in the queue

    def _encode(self) -> None:
        film = _Film(self._part, self._size, self._time_base, self._sound_of)
        try:
            while (job := self._jobs.get()) is not None:
                film.add(job.time_s, job.draw())
        finally:
            film.close()


class _Film:
    """The file: one stream of pictures and, where there is one, one of sound."""

    def __init__(
        self, path: Path, size: tuple[int, int], time_base: Fraction, sound_of: Path | None
    ) -> None:
        self._container = av.open(str(path.absolute()), "w", format="mp4")
        # the size is padded to even numbers, as yuv420p wants it
        self._width, self._height = (side + side % 2 for side in size)
        stream: VideoStream = self._container.add_stream("libx264", options=ENCODER_OPTIONS)
        stream.width, stream.height, stream.pix_fmt = self._width, self._height, "yuv420p"
        stream.codec_context.time_base = time_base
        stream.codec_context.thread_count = 1
        self._stream, self._time_base = stream, time_base
        self._last_pts: int | None = None
        self._last_s = 0.0
        self._sound = _Sound(sound_of, self._container) if sound_of is not None else None

    def add(self, time_s: float, image: Image) -> None:
        """Encode one picture, and copy the sound up to it."""
        bottom, right = self._height - image.shape[0], self._width - image.shape[1]
        if bottom or right:
            image = cv2.copyMakeBorder(  # type: ignore[assignment]
                image, 0, bottom, 0, right, cv2.BORDER_REPLICATE
            )
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        pts = round(time_s / self._time_base)
        if self._last_pts is not None:
            pts = max(pts, self._last_pts + 1)  # a file cannot hold two frames at one time
        frame.pts, frame.time_base = pts, self._time_base
        self._last_pts, self._last_s = pts, time_s
        self._container.mux(self._stream.encode(frame))
        if self._sound is not None:
            self._sound.copy_up_to(time_s)

    def close(self) -> None:
        """Flush the encoder and write the index."""
        try:
            if self._last_pts is not None:
                self._container.mux(self._stream.encode(None))
                if self._sound is not None:
                    self._sound.copy_up_to(self._last_s + 0.1)
        finally:
            if self._sound is not None:
                self._sound.close()
            self._container.close()


class _Sound:
    """Packets of the first sound stream of a clip, copied as they are."""

    def __init__(self, path: Path, into: Any) -> None:
        self._source = av.open(str(path.absolute()))
        self._into = into
        streams = [s for s in self._source.streams.audio if s.codec_context.name in COPIED_SOUND]
        self._packets: Iterator[Packet] = iter(())
        self._next: Packet | None = None
        if streams:
            self._stream: AudioStream = into.add_stream_from_template(streams[0])
            self._packets = self._readable(streams[0])
            self._next = next(self._packets, None)

    def copy_up_to(self, time_s: float) -> None:
        """Copy packets that begin before ``time_s``."""
        while self._next is not None and _begin_s(self._next) <= time_s:
            self._next.stream = self._stream
            self._into.mux(self._next)
            self._next = next(self._packets, None)

    def close(self) -> None:
        """Close the source."""
        self._source.close()

    def _readable(self, stream: AudioStream) -> Iterator[Packet]:
        packets = self._source.demux(stream)
        while True:
            try:
                packet = next(packets)
            except (StopIteration, av.error.FFmpegError, OSError):
                return  # the end, or a break in the file
            if packet.dts is not None:
                yield packet


def _begin_s(packet: Packet) -> float:
    """When a packet begins, in seconds."""
    return float((packet.dts or 0) * Fraction(packet.time_base or 1))
