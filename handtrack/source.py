"""Where a run's frames come from: a file, or a camera that is shown on a page as it is tracked.

The loop of :mod:`handtrack.run` sees no difference: frames, their counts, and a picture to show.
"""

import time
import webbrowser
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Protocol

from handtrack.errors import InputError
from handtrack.evidence.orientation import Image
from handtrack.evidence.video import Limits, VideoInfo, probe, read_frames
from handtrack.live.camera import Camera, is_camera, open_capture
from handtrack.live.page import Page
from handtrack.output.provenance import Counts
from handtrack.records import Frame

__all__ = ["ClipSource", "LiveSource", "Source", "is_camera", "open_source"]

Draw = Callable[[], Image]


class Source(Protocol):
    """Frames and what is known of them."""

    info: VideoInfo
    counts: Counts
    #: Where results go by default.
    out: Path
    #: What a run is that was asked to stop.
    state_when_stopped: str
    #: Whether its frames can be had once more.
    can_begin_again: bool

    def frames(self) -> Generator[Frame, None, None]:
        """The frames in order of time."""
        ...

    def shown(self, draw: Draw) -> Draw:
        """Show the picture if somebody wants to see it now; how the film gets it."""
        ...

    def close(self) -> None:
        """Give back what is held."""
        ...


class ClipSource:
    """A file.

    Raises
    ------
    InputError
        As :func:`handtrack.evidence.video.probe`.
    """

    state_when_stopped = "interrupted"
    can_begin_again = True

    def __init__(self, clip: Path, limits: Limits) -> None:
        self._limits = limits
        self.info = probe(clip, limits)
        self.counts = Counts(container=self.info.n_claimed)
        self.out = Path(f"{clip.stem}.handtrack")

    def frames(self) -> Generator[Frame, None, None]:
        """The frames, decoded ahead."""
        return read_frames(self.info.path, self._limits, self.info)

    def shown(self, draw: Draw) -> Draw:
        """Nobody looks: the film draws in its own thread."""
        return draw

    def close(self) -> None:
        """Nothing is held."""


class LiveSource:
    """A camera and its page. It has no end, so to stop it is to complete it.

    Raises
    ------
    InputError
        The camera cannot be opened or sends nothing, is over the limits, or the port is taken.
    """

    state_when_stopped = "complete"
    can_begin_again = False

    def __init__(self, clip: Path, limits: Limits, port: int, opens: bool) -> None:
        name = str(clip)
        self._camera = Camera(name, open_capture(clip), limits.max_minutes)
        try:
            self.info: VideoInfo = self._camera.info
            self.counts: Counts = self._camera.counts
            if self.info.width_px * self.info.height_px > 1e6 * limits.max_megapixels:
                raise InputError(f"camera {name}: its pictures are over --max-megapixels")
            self._page = Page(port)
        except BaseException:
            self._camera.close()
            raise
        # what a camera saw cannot be had again: no run takes the place of an earlier one
        self.out = Path(f"camera-{clip.stem}-{time.strftime('%Y%m%d-%H%M%S')}.handtrack")
        print(f"live picture at {self._page.address}   (Ctrl-C ends)", flush=True)
        if opens:
            webbrowser.open(self._page.address)

    def frames(self) -> Generator[Frame, None, None]:
        """The frames, always the newest."""
        return self._camera.frames()

    def shown(self, draw: Draw) -> Draw:
        """Drawn now and shown; the film gets the same picture."""
        picture = draw()
        self._page.show(picture)
        return lambda: picture

    def close(self) -> None:
        """Give the camera and the port back."""
        self._page.close()
        self._camera.close()


def open_source(clip: Path, limits: Limits, port: int, opens: bool) -> Source:
    """The clip or the camera that is meant.

    Raises
    ------
    InputError
        It cannot be used.
    """
    if is_camera(clip):
        return LiveSource(clip, limits, port, opens)
    return ClipSource(clip, limits)
