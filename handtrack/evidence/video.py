"""A clip as upright frames of square pixels, each with the container's own time stamp.

What the container says about shape is applied here, once, in this order:

1. sample aspect ratio ``a``: a stored pixel is ``a`` times as wide as high. The longer way is
   shrunk (``a < 1``: width times ``a``; ``a > 1``: height over ``a``), nothing is blown up;
2. the display matrix: quarter turns and mirror images, as phones write them.

Frames whose packet the decoder refuses, or marks as corrupt, come out with no image in their
place. Nothing is resampled in time: ``time_s = pts * time_base``. Limits on size and duration
are checked against the header, before a picture is allocated. Only local files are opened.

>>> shown_size(1240, 720, Fraction(81, 248))
(405, 720)
>>> shown_size(720, 576, Fraction(16, 15))
(720, 540)
"""

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.stream import Disposition
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from handtrack.errors import InputError
from handtrack.evidence.ahead import run_ahead
from handtrack.evidence.orientation import Image, Orientation
from handtrack.records import Frame

#: Frames that may wait between the decoder and the tracker.
N_AHEAD = 4
#: Packets that :func:`probe` tries to decode before it gives up.
N_PROBED = 64
#: Codecs of which every packet is a picture to be shown, so that one without is a loss.
ONE_FRAME_A_PACKET = frozenset({"h264", "hevc", "mjpeg", "prores", "ffv1"})


@dataclass(frozen=True)
class Limits:
    """What is refused before anything is allocated."""

    max_megapixels: float = 40.0
    max_minutes: float = 180.0


@dataclass(frozen=True)
class VideoInfo:
    """What is known of a clip before it is tracked; sizes are of the frames as they come out."""

    path: Path
    width_px: int
    height_px: int
    stored_width_px: int
    stored_height_px: int
    sample_aspect_ratio: Fraction
    orientation: Orientation
    time_base: Fraction
    rate_hz: float | None
    n_claimed: int | None
    duration_s: float | None
    codec: str
    pixel_format: str
    has_audio: bool


def shown_size(width_px: int, height_px: int, aspect: Fraction) -> tuple[int, int]:
    """Width and height in square pixels, shrinking the longer way."""
    if aspect < 1:
        return max(1, round(width_px * aspect)), height_px
    return width_px, max(1, round(height_px / aspect))


def probe(path: str | Path, limits: Limits | None = None) -> VideoInfo:
    """What the container and the first decodable frame of ``path`` say.

    Raises
    ------
    InputError
        The file is missing, empty, not a video, without a picture, or over the limits.
    """
    limits = limits or Limits()
    with _open(Path(path)) as container:
        stream = _picture(container, Path(path))
        _check(stream, _duration_s(container, stream), limits, Path(path))
        first = _first_frame(container, stream)
        if first is None:
            raise InputError(f"{path}: none of its first {N_PROBED} packets holds a picture")
        aspect = Fraction(stream.sample_aspect_ratio or 1)
        aspect = aspect if aspect > 0 else Fraction(1)
        orientation = Orientation.of(first)
        size = shown_size(first.width, first.height, aspect)
        width_px, height_px = size[::-1] if orientation.transpose else size
        hidden = sum(entry.is_discard for entry in stream.index_entries)
        return VideoInfo(
            path=Path(path),
            width_px=width_px,
            height_px=height_px,
            stored_width_px=first.width,
            stored_height_px=first.height,
            sample_aspect_ratio=aspect,
            orientation=orientation,
            time_base=Fraction(stream.time_base or Fraction(1, 1000)),
            rate_hz=float(stream.average_rate) if stream.average_rate else None,
            n_claimed=stream.frames - hidden if stream.frames else None,
            duration_s=_duration_s(container, stream),
            codec=stream.codec_context.name,
            pixel_format=stream.codec_context.pix_fmt or "unknown",
            has_audio=bool(container.streams.audio),
        )


def read_frames(
    path: str | Path, limits: Limits | None = None, info: VideoInfo | None = None
) -> Generator[Frame, None, None]:
    """The frames of ``path`` in the order of their time stamps, decoded ahead in a thread.

    Parameters
    ----------
    path : str or Path
        A local video file.
    limits : Limits
        Raises these to read something larger or longer.
    info : VideoInfo
        What :func:`probe` said, if it was asked already.

    Raises
    ------
    InputError
        As :func:`probe`; or the clip goes on for longer than its header or the limits say.
    """
    limits = limits or Limits()
    known = info or probe(path, limits)
    return run_ahead(lambda: _decode(known, limits), N_AHEAD)


def _decode(info: VideoInfo, limits: Limits) -> Iterator[Frame]:
    """Decode all of the clip; packets that fail become frames without an image."""
    with _open(info.path) as container:
        stream = _picture(container, info.path)
        stream.thread_type = "AUTO"
        stream.codec_context.thread_count = 2
        stream.codec_context.options = {"max_pixels": str(_max_padded(limits))}
        step_s = 1 / info.rate_hz if info.rate_hz else 1 / 30
        index, first_s, last_s = 0, None, -step_s
        for pts, image in _in_time_order(container, stream, info):
            time_s = last_s + step_s if pts is None else float(pts * info.time_base)
            first_s = time_s if first_s is None else first_s
            if time_s - first_s > limits.max_minutes * 60:
                raise _too_long(info.path, limits)
            yield Frame(index, time_s, image)
            index, last_s = index + 1, time_s


def _in_time_order(
    container: InputContainer, stream: VideoStream, info: VideoInfo
) -> Iterator[tuple[int | None, Image | None]]:
    """Time stamps and images; a packet whose frame never came is told when its time is passed."""
    owed: set[int] = set()
    for packet, frame in _decoder_output(container, stream):
        if frame is None:
            if packet.pts is not None and not packet.is_discard:
                owed.add(packet.pts)
            continue
        if frame.pts is not None:
            owed.discard(frame.pts)
            for pts in sorted(pts for pts in owed if pts < frame.pts):
                owed.remove(pts)
                yield pts, None
        yield frame.pts, None if frame.is_corrupt else _image(frame, info)
    for pts in sorted(owed):
        yield pts, None


def _decoder_output(
    container: InputContainer, stream: VideoStream
) -> Iterator[tuple[Packet, VideoFrame | None]]:
    """Decoded frames; before them, None with each packet that failed or owes us a frame."""
    packets = container.demux(stream)
    one_to_one = stream.codec_context.name in ONE_FRAME_A_PACKET
    while True:
        try:
            packet = next(packets)
        except (StopIteration, av.error.FFmpegError, OSError):
            return  # the end, or a break in the file: what came before it stands
        try:
            frames = packet.decode()
        except (av.error.FFmpegError, MemoryError):
            yield packet, None
            continue
        if one_to_one:
            yield packet, None
        for frame in frames:
            yield packet, frame


def _max_padded(limits: Limits) -> int:
    """The limit for the decoder's own, padded pictures, should the size change on the way."""
    return math.ceil(1.5e6 * limits.max_megapixels) + 65536


def _image(frame: VideoFrame, info: VideoInfo) -> Image:
    """RGB, square pixels, upright: size and colour in one pass of the scaler."""
    w, h = info.width_px, info.height_px
    w, h = (h, w) if info.orientation.transpose else (w, h)
    shrinks = frame.width > w or frame.height > h
    rgb = frame.reformat(w, h, "rgb24", interpolation="AREA" if shrinks else "BILINEAR")
    return info.orientation.apply(rgb.to_ndarray().astype(np.uint8, copy=False))


def _open(path: Path) -> InputContainer:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a video file")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path}: is empty")
    try:
        # an absolute path: a name with a colon in it is no network address
        return av.open(str(path.absolute()), options={"protocol_whitelist": "file"})
    except PermissionError as error:
        raise InputError(f"{path}: may not be read ({error.strerror})") from error
    except (av.error.FFmpegError, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: not a video that can be read ({reason})") from error


def _picture(container: InputContainer, path: Path) -> VideoStream:
    """The first stream of moving pictures (a cover picture of a song is none)."""
    for stream in container.streams.video:
        if not stream.disposition & Disposition.attached_pic and stream.codec_context.width:
            return stream
    kinds = sorted({str(stream.type) for stream in container.streams}) or ["nothing"]
    raise InputError(f"{path}: has no moving picture in it, only {' and '.join(kinds)}")


def _check(stream: VideoStream, duration_s: float | None, limits: Limits, path: Path) -> None:
    size = stream.codec_context
    megapixels = size.width * size.height / 1e6
    if megapixels > limits.max_megapixels:
        raise InputError(
            f"{path}: {size.width} x {size.height} pixels are over the limit of "
            f"{limits.max_megapixels:g} megapixels; --max-megapixels raises it"
        )
    if duration_s is not None and duration_s > limits.max_minutes * 60:
        raise _too_long(path, limits)


def _too_long(path: Path, limits: Limits) -> InputError:
    return InputError(
        f"{path}: is longer than the limit of {limits.max_minutes:g} minutes; "
        "--max-minutes raises it"
    )


def _duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    if stream.duration is not None and stream.time_base is not None:
        return float(stream.duration * stream.time_base)
    return container.duration / av.time_base if container.duration is not None else None


def _first_frame(container: InputContainer, stream: VideoStream) -> VideoFrame | None:
    stream.codec_context.thread_count = 1
    for k, (_, frame) in enumerate(_decoder_output(container, stream)):
        if frame is not None:
            return frame
        if k >= 2 * N_PROBED:
            break
    return None
