"""A chunk: the pictures and the layers of some frames, as a script that the page loads when near.

Points are stored in steps of an eighth of a pixel (of half a pixel in very large frames), one after
another as differences; each list has a column ``<name>_n`` with its length in every frame.
"""

import contextlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.layers import FrameLayers
from handtrack.output.report.columns import Column, as_text, pack_columns
from handtrack.output.report.film import GOP
from handtrack.records import FrameResult

Array = NDArray[np.float64]

#: Frames of a chunk: whole groups of pictures.
CHUNK = 8 * GOP
#: Most points of a contour and of the edges that are kept of a frame.
MOST_CONTOUR, MOST_EDGES = 360, 420
#: Kinds of cloud, by number.
KINDS = ("", "particles", "samples")


class Chunk:
    """The file of chunk ``number``: pictures are written as they come, layers when it is closed.

    ``pixel_steps`` make one pixel.
    """

    def __init__(self, folder: Path, number: int, pixel_steps: float) -> None:
        self.pixel_steps = pixel_steps
        self.results: list[FrameResult] = []
        self.layers: list[FrameLayers] = []
        self._file = open(folder / f"{number:06d}.js", "w", encoding="ascii")  # noqa: SIM115
        self._file.write(f"handtrack.chunk({number},[")

    def __len__(self) -> int:
        return len(self.results)

    def add(self, result: FrameResult, layers: FrameLayers, packet: bytes) -> None:
        """One more frame."""
        self.results.append(result)
        self.layers.append(layers)
        self._file.write(f'"{as_text(packet)}",')

    def close(self) -> None:
        """Write the layers."""
        self._file.write(f'],"{as_text(pack_columns(self.columns()))}");\n')
        self._file.close()

    def drop(self) -> None:
        """Close the file, whatever is in it."""
        with contextlib.suppress(OSError):
            self._file.close()

    def columns(self) -> list[Column]:
        """The layers of its frames."""
        L, fine, coarse = self.layers, self.pixel_steps, self.pixel_steps / 4
        columns = self._points("contour", [_every(x.contour, MOST_CONTOUR) for x in L], fine)
        edges = [_strongest(x.edges, MOST_EDGES) for x in L]
        columns += self._points("edge", [e[:, :2] for e in edges], fine)
        columns.append(_bytes("edge_strength", [e[:, 2] for e in edges]))
        columns += self._points("pair", [x.pairs[:, :2] for x in L], fine)
        shift = np.concatenate([x.pairs[:, 2:] - x.pairs[:, :2] for x in L])
        columns.append(Column.quantised("pair_dx", shift[:, 0], fine))
        columns.append(Column.quantised("pair_dy", shift[:, 1], fine))
        columns += self._patches(coarse)
        columns += self._cloud()
        points = np.stack([r.keypoints_px for r in self.results])
        columns.append(Column.quantised("key_x", points[..., 0], fine))
        columns.append(Column.quantised("key_y", points[..., 1], fine))
        return columns

    def _points(self, name: str, points: list[Array], steps: float) -> list[Column]:
        """A list of points ``(n_i, 2)`` a frame."""
        every = np.concatenate(points)
        return [
            Column.plain(f"{name}_n", "u16", [len(p) for p in points]),
            Column.quantised(f"{name}_x", every[:, 0], steps, delta=True),
            Column.quantised(f"{name}_y", every[:, 1], steps, delta=True),
        ]

    def _patches(self, steps: float) -> list[Column]:
        L = self.layers
        corners = [x.patches.reshape(-1, 2) for x in L]
        columns = self._points("patch", corners, steps)
        # corners of a patch; all patches of a frame have as many
        columns.append(Column.plain("patch_v", "u8", [x.patches.shape[1] for x in L]))
        digit = np.concatenate([x.patch_digit for x in L])
        columns.append(Column.plain("patch_digit", "u8", digit + 1))
        columns.append(_bytes("patch_seen", [x.patch_seen for x in L]))
        return columns

    def _cloud(self) -> list[Column]:
        L = self.layers
        tips = np.concatenate([x.tips.reshape(-1, 2) for x in L])
        X = np.concatenate([x.cloud_X for x in L])
        digit = np.concatenate([x.cloud_digit for x in L])
        line = np.array([x.line for x in L])
        return [
            Column.plain("cloud_n", "u16", [len(x.cloud_X) for x in L]),
            Column.plain("cloud_tips", "u8", [x.tips.shape[1] for x in L]),
            Column.plain("cloud_kind", "u8", [KINDS.index(x.cloud_kind) for x in L]),
            Column.plain("cloud_size", "i32", [x.cloud_size for x in L]),
            Column.quantised("tip_x", tips[:, 0], 1),
            Column.quantised("tip_y", tips[:, 1], 1),
            Column.quantised("cloud_X0", X[:, 0], 50),
            Column.quantised("cloud_X1", X[:, 1], 50),
            _bytes("cloud_weight", [x.cloud_weight for x in L]),
            Column.plain("cloud_digit", "u8", digit + 1),
            Column.plain("line_i", "u8", line[:, 0] + 1),
            Column.plain("line_j", "u8", line[:, 1] + 1),
        ]


def _bytes(name: str, shares: list[Array]) -> Column:
    """Numbers from 0 to 1 in a byte each."""
    every = np.concatenate(shares)
    return Column.plain(name, "u8", np.round(255 * np.clip(every, 0, 1)))


def _every(points: Array, most: int) -> Array:
    """Every second point, or fewer: ``most`` at the most."""
    step = max(2, -(-len(points) // most))
    return points[::step] if len(points) > 20 else points


def _strongest(edges: Array, most: int) -> Array:
    """The strongest edges, in the order in which they were found."""
    if len(edges) <= most:
        return edges
    return edges[np.sort(np.argsort(-edges[:, 2], kind="stable")[:most])]
