"""Writes the report while the clip runs: chunks of layers as they fill, the page at the end.

All the work is done in a thread of its own. Of the clip nothing is kept in memory but the chunk
that is being filled. Everything lies under hidden names until :meth:`ReportWriter.finish`.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.layers import FrameLayers
from handtrack.output.files import hidden_beside, open_whole, put_in_place
from handtrack.output.report.chunk import CHUNK, KINDS, Chunk
from handtrack.output.report.columns import as_text, pack_columns
from handtrack.output.report.curves import SIDES, STATUSES, Curves, TrueMotion
from handtrack.output.report.film import CODEC, GOP, Film
from handtrack.output.report.page import page
from handtrack.output.report.worker import Worker
from handtrack.records import FrameResult

Image = NDArray[np.uint8]

REPORT_HTML, REPORT_FILES = "report.html", "report_files"
#: Frames longer than this have coarser steps, so that two bytes reach.
FINE_UP_TO_PX = 3500


class ReportWriter:
    """Takes the frames as they come.

    Parameters
    ----------
    folder : Path
        Where ``report.html`` and ``report_files`` go.
    width_px, height_px : int
        Size of the frames.

    Raises
    ------
    OutputError
        Something cannot be written; raised by the next call after it happened.
    """

    def __init__(self, folder: Path, width_px: int, height_px: int) -> None:
        self._folder, self._size = folder, (width_px, height_px)
        self._part = hidden_beside(folder / REPORT_FILES)
        self._film = Film(width_px, height_px)
        self._steps = 8.0 if max(self._size) <= FINE_UP_TO_PX else 2.0
        self._chunk: Chunk | None = None
        self._n_chunks = 0
        try:
            self._part.mkdir()
        except OSError as error:
            raise self._cannot(error) from error
        self._curves = Curves(self._part / "curves.part")
        self._times = _Times(self._part / "times.js")
        self._worker = Worker("report")

    def add(
        self,
        result: FrameResult,
        image: Image | None,
        layers: Callable[[], FrameLayers],
        ms: float,
    ) -> None:
        """One more frame, its picture as filmed ``(H, W, 3)`` and the ms that it took.

        ``layers()`` is called in the report's thread.
        """
        self._worker.put(lambda: self._take(result, image, layers(), ms))

    def finish(self, facts: Mapping[str, Any], truth: TrueMotion | None = None) -> None:
        """Write what is left and put it all in its place; without frames there is no report."""
        try:
            self._worker.close()
            self._worker.raise_fault()
            if self._curves.n:
                self._close_chunk()
                self._times.close()
                block = as_text(pack_columns(self._curves.columns(truth)))
                self._curves.discard()
                text = page(self._facts(facts, truth is not None), block)
                self._put_in_place(text)
        except OSError as error:
            raise self._cannot(error) from error
        finally:
            self._clear()

    def discard(self) -> None:
        """Leave nothing behind."""
        self._worker.close()
        self._clear()

    def _take(
        self, result: FrameResult, image: Image | None, layers: FrameLayers, ms: float
    ) -> None:
        packet = self._film.packet(image)
        try:
            if self._chunk is None:
                self._chunk = Chunk(self._part, self._n_chunks, self._steps)
                self._n_chunks += 1
            self._chunk.add(result, layers, packet)
            self._curves.add(result, layers)
            self._times.add(ms)
            if len(self._chunk) == CHUNK:
                self._close_chunk()
        except OSError as error:
            raise self._cannot(error) from error

    def _close_chunk(self) -> None:
        if self._chunk is not None:
            self._chunk.close()
        self._chunk = None

    def _facts(self, facts: Mapping[str, Any], has_truth: bool) -> dict[str, Any]:
        film = self._film
        return {
            **facts,
            "n": self._curves.n,
            "chunk": CHUNK,
            "n_chunks": self._n_chunks,
            "gop": GOP,
            "codec": CODEC,
            "size": self._size,
            "film_size": (film.width, film.height),
            "film_used": (film.used_width, film.used_height),
            "statuses": STATUSES,
            "sides": SIDES,
            "kinds": KINDS,
            "truth": has_truth,
        }

    def _put_in_place(self, text: str) -> None:
        """The page goes first and comes last: it never stands beside another run's chunks."""
        html, files = self._folder / REPORT_HTML, self._folder / REPORT_FILES
        with open_whole(self._part / REPORT_HTML) as file:
            file.write(text)
        if html.exists():
            # moved, not removed: a number of its own tells the new file from the old one
            put_in_place(html, hidden_beside(html).with_suffix(".old"))
        remove_files(self._folder)
        self._part.rename(files)
        put_in_place(files / REPORT_HTML, html)

    def _clear(self) -> None:
        if self._chunk is not None:
            self._chunk.drop()
        self._curves.discard()
        self._times.close()
        hidden_beside(self._folder / REPORT_HTML).with_suffix(".old").unlink(missing_ok=True)
        shutil.rmtree(self._part, ignore_errors=True)

    def _cannot(self, error: OSError) -> OutputError:
        path = self._folder / REPORT_FILES
        return OutputError(f"{path}: cannot be written ({error.strerror})")


class _Times:
    """``times.js``: milliseconds of every frame, as they come."""

    def __init__(self, path: Path) -> None:
        self._file = open(path, "w", encoding="ascii")  # noqa: SIM115
        self._file.write("handtrack.times([")

    def add(self, ms: float) -> None:
        self._file.write(json.dumps(round(ms, 2)) + ",")

    def close(self) -> None:
        if not self._file.closed:
            self._file.write("]);\n")
            self._file.close()


def remove_files(folder: Path) -> None:
    """Remove an earlier run's ``report_files``, but no file in it that is none of ours.

    Raises
    ------
    OutputError
        It cannot be removed, or holds other files.
    """
    files = folder / REPORT_FILES
    try:
        for path in sorted(files.glob("*.js")):
            if path.stem == "times" or (path.stem.isdigit() and len(path.stem) >= 6):
                path.unlink()
        if files.exists():
            files.rmdir()
    except OSError as error:
        raise OutputError(
            f"{files}: cannot be replaced ({error.strerror}); move it away"
        ) from error
