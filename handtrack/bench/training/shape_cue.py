"""Training of the shape cue's network: what of a picture is hand."""

from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import torch

from handtrack.bench.training import people
from handtrack.bench.training.grounds import SIDE_PX, Pixels, ground, photographs
from handtrack.bench.training.scenes import Scene, scene_from
from handtrack.bench.training.shape_model import ShapeNetwork, shape_loss
from handtrack.bench.training.train import Batch, TrainingSettings, export, in_processes, train
from synth.pictures import Picture

#: As much as the shipped network has learned, in one round (it had two: docs/shape_cue.md).
SHIPPED = TrainingSettings(pictures=82_000, steps=9_100, rate=2e-3, batch=48)
#: What hands are laid over, and how much of it a process draws at a time.
GROUNDS, AT_ONCE = 12_000, 300
#: How many of MakeHuman's people are among it.
PORTRAITS = 1_800


def trained(
    taught: list[Picture], grounds: list[Pixels], settings: TrainingSettings
) -> ShapeNetwork:
    """A network that has learned from some pictures, laid over some grounds."""
    torch.manual_seed(settings.seed)
    draw = some_scenes(taught, grounds, settings.batch)
    return train(ShapeNetwork(), draw, shape_loss, settings)


def some_grounds(
    photos: Path,
    folder: Path | None,
    makehuman: Path | None,
    seed: int,
    count: int = GROUNDS,
) -> list[Pixels]:
    """Grounds of the photographs in a folder, of people, and of textures.

    People are those of the photographs in another ``folder``, as many of MakeHuman's, or either.
    """
    portraits = [] if folder is None else photographs(folder)
    if makehuman is not None:
        made = in_processes(partial(_portraits, makehuman), PORTRAITS, AT_ONCE, seed)
        portraits = portraits * (PORTRAITS // max(len(portraits), 1)) + made
    return in_processes(partial(_grounds, photographs(photos), portraits), count, AT_ONCE, seed)


def _grounds(
    photos: list[Pixels], shown: list[Pixels], seed: np.random.SeedSequence
) -> list[Pixels]:
    rng = np.random.default_rng(seed)
    return [ground(photos, shown, rng) for _ in range(AT_ONCE)]


def _portraits(makehuman: Path, seed: np.random.SeedSequence) -> list[Pixels]:
    return list(islice(people.portraits(makehuman, np.random.default_rng(seed)), AT_ONCE))


def some_scenes(
    taught: list[Picture], grounds: list[Pixels], count: int
) -> Callable[[np.random.Generator], Batch]:
    """A draw of scenes."""
    return lambda rng: stacked([scene_from(taught, grounds, rng) for _ in range(count)])


def stacked(scenes: list[Scene]) -> Batch:
    """Tensors of what is seen, and of how much of it is skin at half the resolution."""
    half = (SIDE_PX // 2, SIDE_PX // 2)
    seen = np.stack([scene.seen.transpose(2, 0, 1) for scene in scenes]).astype(np.float32)
    skin = [cv2.resize(scene.skin, half, interpolation=cv2.INTER_AREA)[None] for scene in scenes]
    return [torch.from_numpy(seen), torch.from_numpy(np.stack(skin))]


def write(network: ShapeNetwork, path: Path) -> None:
    """The ONNX file that :mod:`handtrack.evidence.shape_cue` reads."""
    export(network, torch.zeros(1, 3, SIDE_PX, SIDE_PX), path, ("h", "w"))
