"""How fast: hypotheses a second, and how time grows with particles and with pixels.

The likelihood is timed on one frame's evidence for growing batches of hypotheses, and for windows
of growing size; :func:`whole_run` times the default method from file to tables, by stage.
"""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera, Window
from handtrack.errors import InputError
from handtrack.evidence.evidence import see
from handtrack.evidence.silhouette import Segmenter
from handtrack.evidence.video import read_frames
from handtrack.fingers.likelihood import FingerLikelihood, LikelihoodSettings
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Capsules, Cardboard, Surface
from handtrack.records import Pose
from handtrack.refine.view import View
from handtrack.run import RunSettings, run_clip
from handtrack.window import window_for

Array = NDArray[np.float64]
_SURFACES: dict[str, Callable[[HandShape], Surface]] = {
    "capsules": Capsules,
    "cardboard": Cardboard,
}


@dataclass(frozen=True)
class Timing:
    """One measurement, the best of some repeats."""

    what: str
    size: int  # hypotheses, or pixels along the side of the window
    ms: float

    @property
    def per_second(self) -> float:
        """How many of ``size`` in a second."""
        return 1e3 * self.size / self.ms


def time_likelihood(
    folder: Path,
    space: ConfigurationSpace,
    counts: Sequence[int] = (10, 30, 100, 300, 1000, 3000),
    sides_px: Sequence[int] = (64, 128, 256, 512),
) -> list[Timing]:
    """Batches of hypotheses on the first frame of a synthetic clip, and windows of all sizes."""
    image, pose, shape, camera, mask = _first(folder)
    segmenter = Segmenter.from_mask(image, mask)
    usual = window_for(pose, shape, camera)
    rng = np.random.default_rng(0)
    theta = space.to_angles(rng.normal(size=(max(counts), space.n_dims)) * space.variance**0.5)
    timings = []
    view = View.of(see(image, usual, camera, segmenter))
    for name, surface in _SURFACES.items():
        score = FingerLikelihood(surface(shape), view, pose, LikelihoodSettings())
        timings += [Timing(f"likelihood, {name}", n, best_ms(score, theta[:n])) for n in counts]
    for side in sides_px:
        window = _of_side(usual, side)
        timings.append(Timing("evidence", side, best_ms(see, image, window, camera, segmenter)))
        seen = View.of(see(image, window, camera, segmenter))
        score = FingerLikelihood(Capsules(shape), seen, pose, LikelihoodSettings())
        timings.append(Timing("100 hypotheses", side, best_ms(score, theta[:100])))
    return timings


def whole_run(clip: Path, out: Path) -> dict[str, float]:
    """Frames a second of ``handtrack run`` without overlay, peak memory, and medians by stage."""
    camera = clip / "camera.toml"
    run_clip(
        RunSettings(
            clip / "clip.mp4", out=out, camera=camera, overlay=False, report=False, quiet=True
        )
    )
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    return {
        "frames_per_second": record["frames_per_second"],
        "peak_memory_mb": record["peak_memory_mb"],
        **{f"{stage} ms": ms for stage, ms in record["timings_ms"].items()},
    }


def best_ms(call: Callable[..., object], *arguments: object, repeats: int = 5) -> float:
    """Least time of a call, after one that compiles."""
    call(*arguments)
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call(*arguments)
        spent.append(1e3 * (time.perf_counter() - begin))
    return min(spent)


def _of_side(window: Window, side: int) -> Window:
    """The same part of the frame in ``side`` pixels."""
    return Window(window.x_px, window.y_px, window.scale * side / window.width_px, side, side)


def _first(
    folder: Path,
) -> tuple[NDArray[np.uint8], Pose, HandShape, Camera, NDArray[np.bool_]]:
    camera, shape = Camera.load(folder / "camera.toml"), HandShape.load(folder / "shape.toml")
    with np.load(folder / "truth.npz", allow_pickle=False) as truth:
        pose = Pose(truth["R"][0], truth["t_mm"][0])
        mask = np.unpackbits(truth["mask"][0], axis=-1)[:, : camera.width_px].astype(bool)
    with closing(read_frames(folder / "clip.mp4")) as clip:
        for frame in clip:
            if frame.image is not None:
                return frame.image, pose, shape, camera, mask
    raise InputError(f"{folder / 'clip.mp4'}: no frame can be decoded")
