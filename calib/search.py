"""The best open palm among pictures: candidate silhouettes, each calibrated, the best one kept.

>>> import numpy as np
>>> best_hand([(0, np.zeros((60, 80, 3), np.uint8))], Camera.assumed_for).found is None
True
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.hand import CalibrationResult, calibrate_hand
from calib.seen import Seen
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.evidence.evidence import Evidence, see, window_around
from handtrack.evidence.silhouette import Segmenter
from handtrack.evidence.video import probe, read_frames

Image = NDArray[np.uint8]
IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})
#: The hand's window is larger here than in tracking: it is looked at only once.
WINDOW_PX = 448
N_CANDIDATES = 4
GOOD_ENOUGH = 0.97
MAX_LOOKED_AT = 60


@dataclass(frozen=True, eq=False)
class FoundHand:
    """A calibrated hand and the picture it was found in."""

    frame: int
    image: Image  # (H, W, 3) the whole picture
    evidence: Evidence
    result: CalibrationResult

    def mm_per_px(self) -> float:
        """Millimetres a pixel of the whole picture at the depth of the middle of the palm."""
        middle = self.result.pose @ np.array([0.0, 0.5 * self.result.shape.palm_length_mm, 0.0])
        return float(middle[2] / self.evidence.camera.fx_px * self.evidence.window.scale)

    def hand_mask(self) -> NDArray[np.bool_]:
        """The hand's silhouette ``(H, W)`` in the whole picture."""
        inside = np.zeros(self.image.shape[:2], np.uint8)
        window = self.evidence.window
        outlines, _ = cv2.findContours(
            self.evidence.mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        polygons = [np.round(window.to_frame(o[:, 0])).astype(np.int32) for o in outlines]
        cv2.fillPoly(inside, polygons, 1)
        return inside > 0


@dataclass
class Search:
    """The best hand so far, and what else was seen."""

    found: FoundHand | None = None
    looked_at: int = 0
    refusals: dict[Seen, int] = field(default_factory=dict)

    def reason(self) -> str:
        """What stood in the way most often, leaving aside candidates that were no hand at all."""
        telling = {s: n for s, n in self.refusals.items() if s is not Seen.NOTHING}
        return max(telling, key=lambda s: telling[s]).sentence if telling else Seen.NOTHING.sentence


def best_hand(
    pictures: Iterable[tuple[int, Image]],
    camera_of: Callable[[int, int], Camera],
    min_quality: float = 0.35,
    **options: Any,
) -> Search:
    """Look at numbered RGB ``pictures`` until one is good enough; ``options`` as `calibrate_hand`.

    ``camera_of`` gives the camera for a width and a height.
    """
    search = Search()
    for index, image in pictures:
        search.looked_at += 1
        camera = camera_of(image.shape[1], image.shape[0])
        for candidate in Segmenter.bootstrap(image)[:N_CANDIDATES]:
            segmenter = Segmenter.from_mask(image, candidate.mask)
            window = window_around(candidate.mask, WINDOW_PX)
            evidence = see(image, window, camera, segmenter)
            result = calibrate_hand(
                evidence.mask, evidence.camera, visible=evidence.visible,
                min_quality=min_quality, **options,
            )  # fmt: skip
            if not result.ok:
                search.refusals[result.status] = search.refusals.get(result.status, 0) + 1
            elif search.found is None or result.quality > search.found.result.quality:
                search.found = FoundHand(index, image, evidence, result)
        if search.found is not None and search.found.result.quality >= GOOD_ENOUGH:
            break
    return search


def pictures_of(
    path: Path, frame: int | None = None, at_most: int = MAX_LOOKED_AT
) -> Iterator[tuple[int, Image]]:
    """RGB pictures of a photograph or of a clip (about ``at_most``, spread over it).

    Raises
    ------
    InputError
        The file cannot be read, or the clip has no frame of that number.
    """
    if path.suffix.lower() in IMAGE_SUFFIXES:
        yield 0, _photograph(path)
        return
    info = probe(path)
    step = max(1, round((info.n_claimed or 600) / at_most))
    last = -1
    for shown in read_frames(path, info=info):
        last = shown.index
        wanted = last % step == 0 if frame is None else last == frame
        if wanted and shown.image is not None:
            yield last, shown.image
            if frame is not None:
                return
    if frame is not None:
        raise InputError(f"{path}: no frame {frame}, the clip has frames 0 to {last}")


def _photograph(path: Path) -> Image:
    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot read it ({error.strerror})") from error
    try:
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error:
        image = None  # more pixels than OpenCV will take, or a broken header
    if image is None:
        raise InputError(f"{path}: not a picture that can be read")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)
