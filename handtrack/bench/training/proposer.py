"""Training of the proposer's network: what to think of a silhouette and its shading."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch

from handtrack.bench.training.lessons import Lesson, lesson_from
from handtrack.bench.training.proposer_model import ProposerNetwork, loss_of
from handtrack.bench.training.train import Batch, TrainingSettings, export, train
from handtrack.proposer.picture import SIDE_PX
from synth.pictures import Picture

#: As much as the shipped network has learned, in one round (it had two: docs/proposer.md).
SHIPPED = TrainingSettings(pictures=82_000, steps=17_400, rate=1.2e-3, batch=128)


def trained(taught: list[Picture], settings: TrainingSettings) -> ProposerNetwork:
    """A network that has learned from some pictures."""
    torch.manual_seed(settings.seed)
    return train(ProposerNetwork(), some_lessons(taught, settings.batch), loss_of, settings)


def some_lessons(taught: list[Picture], count: int) -> Callable[[np.random.Generator], Batch]:
    """A draw of lessons from some pictures."""

    def draw(rng: np.random.Generator) -> Batch:
        chosen = rng.integers(len(taught), size=count)
        return stacked([lesson_from(taught[k], rng) for k in chosen])

    return draw


def stacked(lessons: list[Lesson]) -> Batch:
    """Tensors of what is seen, the angles, the rotations and the places of some lessons."""
    columns = [np.stack([getattr(lesson, f.name) for lesson in lessons]) for f in fields(Lesson)]
    return [torch.from_numpy(column) for column in columns]


def write(network: ProposerNetwork, path: Path) -> None:
    """The ONNX file that :mod:`handtrack.proposer.network` reads."""
    export(network, torch.zeros(1, 2, SIDE_PX, SIDE_PX), path)
