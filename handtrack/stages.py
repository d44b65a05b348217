"""Pictures of every stage of a frame, for people who ask why it went wrong (``--debug DIR``).

From left to right: the crop that was worked on, the probability of hand, its outline on the crop,
the edges coloured by direction, and beside them the frame with the hand drawn over it. Of a left
hand the crop is mirrored, as it is tracked.
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import OutputError
from handtrack.evidence.evidence import Evidence

Image = NDArray[np.uint8]

#: Height of the row of pictures.
HEIGHT_PX = 480


def stage_picture(evidence: Evidence | None, drawn: Image) -> Image:
    """The stages side by side, RGB; only ``drawn`` where there is no evidence."""
    panels = [] if evidence is None else _panels(evidence)
    return np.hstack([_of_height(panel) for panel in [*panels, drawn]])


def _panels(evidence: Evidence) -> list[Image]:
    crop = np.ascontiguousarray(evidence.image)
    grey = np.round(255 * np.clip(evidence.probability, 0, 1)).astype(np.uint8)
    probability = cv2.cvtColor(cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB)
    outline = crop.copy()
    fixed = np.round(evidence.contour * 8).astype(np.int32)
    if len(fixed) > 1:
        cv2.polylines(outline, [fixed], True, (255, 255, 0), 1, cv2.LINE_AA, 3)
    direction = np.mod(evidence.edge_direction, np.pi) / np.pi * 180
    strength = np.round(255 * np.clip(evidence.edge_strength, 0, 1)).astype(np.uint8)
    hue = np.stack([direction.astype(np.uint8), np.full_like(strength, 255), strength], axis=-1)
    edges = cv2.cvtColor(hue, cv2.COLOR_HSV2RGB)
    return [crop, _bytes(probability), outline, _bytes(edges)]


def write_picture(path: Path, image: Image) -> None:
    """Write an RGB image as PNG.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    _, data = cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def _of_height(image: Image) -> Image:
    width = max(1, round(image.shape[1] * HEIGHT_PX / image.shape[0]))
    return _bytes(cv2.resize(image, (width, HEIGHT_PX), interpolation=cv2.INTER_AREA))


def _bytes(image: NDArray[np.generic]) -> Image:
    return np.asarray(image, dtype=np.uint8)
