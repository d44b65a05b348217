"""A picture of the evidence, for people: three panels side by side.

Crop with outline (green where the picture has an edge, yellow where not) and the points of edges
inside the hand (cyan); probability with the outline of the mask; strength of the edges.

>>> from handtrack.camera import Camera, Window
>>> from handtrack.evidence.evidence import see
>>> from handtrack.evidence.silhouette import Segmenter
>>> frame = np.full((64, 64, 3), 60, np.uint8)
>>> frame[20:44, 20:44] = (210, 150, 130)
>>> segmenter = Segmenter.from_mask(frame, frame[..., 0] > 100)
>>> window = Window(0.0, 0.0, 1.0, 64, 64)
>>> seen = see(frame, window, Camera.assumed_for(64, 64), segmenter)
>>> draw_evidence(frame, seen, zoom=2).shape
(128, 384, 3)
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.evidence.evidence import Evidence, crop

Pixels = NDArray[np.uint8]

_EDGE, _BARE, _INNER = (0, 255, 0), (255, 255, 0), (0, 255, 255)


def draw_evidence(frame_rgb: Pixels, evidence: Evidence, zoom: int = 3) -> Pixels:
    """The panels ``(zoom h, 3 zoom w, 3)`` of the evidence of a frame ``(H, W, 3)``, RGB."""
    h, w = evidence.mask.shape
    size = (w * zoom, h * zoom)
    panels = [
        np.asarray(cv2.resize(panel, size, interpolation=cv2.INTER_NEAREST), np.uint8)
        for panel in (
            crop(frame_rgb, evidence.window),
            _grey(evidence.probability),
            _grey(evidence.edge_strength),
        )
    ]
    inner = evidence.edge_points[_at(evidence.sdf, evidence.edge_points) < -2.0]
    _dots(panels[0], inner, _INNER, zoom)
    for panel in panels[:2]:
        _dots(panel, evidence.contour[evidence.contour_snapped], _EDGE, zoom)
        _dots(panel, evidence.contour[~evidence.contour_snapped], _BARE, zoom)
    text = f"confidence {evidence.confidence:.2f}"
    cv2.putText(panels[1], text, (4, 7 * zoom), 0, 0.2 * zoom, (255, 80, 80), max(1, zoom // 2))
    return np.asarray(np.hstack(panels), np.uint8)


def _grey(values: NDArray[np.float32]) -> Pixels:
    """Values 0 to 1 ``(h, w)`` as grey ``(h, w, 3)``."""
    return np.repeat((255 * np.clip(values, 0, 1)).astype(np.uint8)[..., None], 3, axis=2)


def _at(values: NDArray[np.float32], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values ``(n,)`` of a map at the pixels nearest to points ``(n, 2)``."""
    x, y = np.rint(points).astype(int).T
    return np.asarray(values[y, x], np.float32)


def _dots(panel: Pixels, points: NDArray[np.float32], colour: tuple[int, ...], zoom: int) -> None:
    """One pixel for each point, drawn into the panel."""
    x, y = np.rint((points + 0.5) * zoom - 0.5).astype(int).T
    panel[np.clip(y, 0, len(panel) - 1), np.clip(x, 0, panel.shape[1] - 1)] = colour
