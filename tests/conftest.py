"""Fixtures that every test may ask for."""

import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

# one thread each: the tests share the machine, and results must not depend on how many there are
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of recordings that is laid beside the checkout and never committed."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not (folder / "clips").is_dir():
        pytest.skip(f"no recordings at {folder}: this test needs them")
    return folder


@pytest.fixture(scope="session")
def gl() -> None:
    """Skip where the smooth hand cannot be drawn."""
    from handtrack.camera import Camera  # once the threads are set
    from synth.render import NoGLError, Renderer

    try:
        with Renderer(Camera.assumed_for(64, 64)):
            pass
    except NoGLError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def write_clip() -> Callable[..., Path]:
    """A function that writes a small clip; see :func:`_write_clip` for what can be asked of it."""
    return _write_clip


def quadrants(width: int, height: int, shift: int = 0) -> NDArray[np.uint8]:
    """Red, green / blue, white quarters: which way is up can be told from the corners."""
    image = np.zeros((height, width, 3), np.uint8)
    top, left = height // 2, width // 2
    image[:top, :left, 0] = 255
    image[:top, left:, 1] = 255
    image[top:, :left, 2] = 255
    image[top:, left:] = 255
    image[top - 4 : top + 4, (8 + shift) % max(1, width - 8) :][:, :8] = 0
    return image


def _write_clip(
    path: Path,
    n: int = 10,
    size: tuple[int, int] = (96, 64),
    *,
    codec: str = "libx264",
    pixel_format: str = "yuv420p",
    pts_ms: Sequence[int] | None = None,
    aspect: Fraction | None = None,
    rotate_deg: float = 0,
    mirror: bool = False,
    audio: bool = False,
    picture: bool = True,
    movflags: str = "faststart",
) -> Path:
    """Write ``n`` frames of :func:`quadrants`; ``pts_ms`` are their time stamps."""
    options = {"movflags": movflags} if path.suffix == ".mp4" and movflags else {}
    with av.open(str(path), "w", options=options) as container:
        if picture:
            stream = container.add_stream(codec, rate=25)
            stream.width, stream.height, stream.pix_fmt = *size, pixel_format
            stream.codec_context.time_base = Fraction(1, 1000)
            if aspect is not None:
                stream.codec_context.sample_aspect_ratio = aspect
            if rotate_deg or mirror:
                stream.set_display_rotation(rotate_deg, hflip=mirror)
        if audio:
            sound = container.add_stream("aac", rate=8000, layout="mono")
        if picture:
            for k in range(n):
                frame = av.VideoFrame.from_ndarray(quadrants(*size, 3 * k), format="rgb24")
                frame.pts = 40 * k if pts_ms is None else pts_ms[k]
                frame.time_base = Fraction(1, 1000)
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        if audio:
            silence = np.zeros((1, 1024), np.float32)
            for k in range(max(1, 8 * 40 * n // 1024)):
                part = av.AudioFrame.from_ndarray(silence, format="fltp", layout="mono")
                part.sample_rate, part.pts = 8000, 1024 * k
                container.mux(sound.encode(part))
            container.mux(sound.encode(None))
    return path
