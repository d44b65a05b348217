"""Training of the facing cue's network: whether a hand shows its palm or its back, and which way
round it is.

Every picture is mirrored as often as not. The silhouette of a palm is then that of a back as often,
and says nothing of that; creases, nails, shading and the fingers before the palm are what is left.
Much of the skin is creased and porous in its own way, so that those of the renders alone do not do.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch

from handtrack.bench.training.facing_model import FacingNetwork, facing_loss
from handtrack.bench.training.grounds import texture
from handtrack.bench.training.lessons import Float, lesson_from
from handtrack.bench.training.skin import as_skin
from handtrack.bench.training.train import Batch, TrainingSettings, export, train
from handtrack.proposer.picture import SIDE_PX
from synth.pictures import PALM_PX, Picture
from synth.pictures import SIDE_PX as PICTURE_PX

#: As much as the shipped network has learned.
SHIPPED = TrainingSettings(pictures=12_000, steps=6_000, rate=1.5e-3, batch=96, decay=2e-2)
#: Cosine of the angle to the camera's axis below which a palm is edge-on, and teaches nothing.
EDGE_ON = 0.2
#: Share of the hands that look as if of skin; the others are as smooth as they were rendered.
CREASED = 0.6
#: By how much the fingers of a hand in track are off where they are taken to point.
OFF_UPRIGHT = np.radians(15)


def trained(taught: list[Picture], settings: TrainingSettings) -> FacingNetwork:
    """A network that has learned from some pictures."""
    torch.manual_seed(settings.seed)
    return train(FacingNetwork(), some_lessons(taught, settings.batch), facing_loss, settings)


def some_lessons(taught: list[Picture], count: int) -> Callable[[np.random.Generator], Batch]:
    """A draw of lessons, as many palms as backs: what is seen, and the truth ``(n, 2)``.

    1 for a palm; and 1 where the thumb is to the right of fingers that point up.
    """
    palms = [picture for picture in taught if picture.R[2, 2] < -EDGE_ON]
    backs = [picture for picture in taught if picture.R[2, 2] > EDGE_ON]

    def draw(rng: np.random.Generator) -> Batch:
        is_palm, mirrored = rng.random((2, count)) < 0.5
        chosen = [palms if palm else backs for palm in is_palm]
        seen = np.stack([_lesson(those[rng.integers(len(those))], rng) for those in chosen])
        seen[mirrored] = seen[mirrored, ..., ::-1]
        truth = np.column_stack([is_palm, is_palm != mirrored]).astype(np.float32)
        return [torch.from_numpy(seen), torch.from_numpy(truth)]

    return draw


def _lesson(picture: Picture, rng: np.random.Generator) -> Float:
    """What is seen ``(2, SIDE_PX, SIDE_PX)`` of a right hand, other every time."""
    if rng.random() < CREASED:
        skin = as_skin(PALM_PX, texture(rng).astype(np.uint8), rng).mean(axis=-1)
        skin = cv2.resize(skin, (PICTURE_PX, PICTURE_PX))
        picture = replace(picture, grey=np.clip(picture.grey * skin, 0, 255).astype(np.uint8))
    return lesson_from(picture, rng, OFF_UPRIGHT).seen


def write(network: FacingNetwork, path: Path) -> None:
    """The ONNX file that :mod:`handtrack.proposer.facing_cue` reads."""
    export(network, torch.zeros(1, 2, SIDE_PX, SIDE_PX), path)
