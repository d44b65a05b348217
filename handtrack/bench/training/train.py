"""Render pictures and train the proposer's network on them: ``python -m handtrack.bench.training``.

Needs PyTorch, which nothing else here does (``pip install handtrack[training]``).
"""

import queue
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from handtrack.bench.training.lessons import Lesson, lesson_from
from handtrack.bench.training.model import Network, loss_of
from handtrack.proposer.picture import SIDE_PX
from synth.pictures import Picture, pictures

#: Pictures whose lessons are drawn together.
BATCH = 128
AHEAD = 6
#: Pictures that one process renders at a time.
AT_ONCE = 300
_WARM_UP = 200


@dataclass(frozen=True)
class TrainingSettings:
    """As much as the shipped network has learned, in one round (it had two: docs/proposer.md)."""

    pictures: int = 82_000
    """Rendered pictures, each of which gives another lesson every time."""
    steps: int = 17_400
    """Steps of 128 lessons."""
    rate: float = 1.2e-3
    """Highest learning rate; it falls along a cosine."""
    decay: float = 1e-2
    """Weight decay (AdamW)."""
    seed: int = 0
    """Seed of pictures, lessons and first weights."""


def rendered(count: int, seed: int, cache: Path) -> list[Picture]:
    """Pictures, kept in ``cache`` (an ``.npz``) and taken from there if they are."""
    if cache.exists():
        with np.load(cache, allow_pickle=False) as data:
            columns = {name: data[name] for name in data.files}
        return [
            Picture(**{name: column[k] for name, column in columns.items()})
            for k in range(len(columns["focal_px"]))
        ]
    seeds = np.random.SeedSequence(seed).spawn(-(-count // AT_ONCE))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        parts = tqdm(pool.map(_some_pictures, seeds), total=len(seeds), unit=f"{AT_ONCE} pictures")
        made = [picture for part in parts for picture in part][:count]
    columns = {f.name: np.array([getattr(p, f.name) for p in made]) for f in fields(Picture)}
    np.savez(cache, allow_pickle=False, **columns)
    return made


def _some_pictures(seed: np.random.SeedSequence) -> list[Picture]:
    return list(islice(pictures(np.random.default_rng(seed)), AT_ONCE))


def batches(taught: list[Picture], seed: int) -> Iterator[list[Tensor]]:
    """Batches of lessons without end, made beside the training."""
    rng = np.random.default_rng(seed)
    waiting: queue.Queue[list[Tensor]] = queue.Queue(AHEAD)

    def teach() -> None:
        while True:
            chosen = rng.integers(len(taught), size=BATCH)
            waiting.put(stacked([lesson_from(taught[k], rng) for k in chosen]))

    threading.Thread(target=teach, daemon=True).start()
    while True:
        yield waiting.get()


def stacked(lessons: list[Lesson]) -> list[Tensor]:
    """Tensors of what is seen, the angles, the rotations and the places of some lessons."""
    columns: list[NDArray] = [
        np.stack([getattr(lesson, field.name) for lesson in lessons]) for field in fields(Lesson)
    ]
    return [torch.from_numpy(column) for column in columns]


def train(taught: list[Picture], settings: TrainingSettings) -> Network:
    """A network that has learned from some pictures."""
    torch.manual_seed(settings.seed)
    cv2.setNumThreads(1)  # pictures are small
    network = Network().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=settings.decay)
    source = batches(taught, settings.seed)
    bar = tqdm(range(settings.steps), unit="step")
    for step in bar:
        share = step / settings.steps
        rate = settings.rate * (0.5 + 0.5 * np.cos(np.pi * share) + 0.01)
        optimiser.param_groups[0]["lr"] = rate * min(1.0, step / _WARM_UP)
        seen, *truth = next(source)
        loss = loss_of(network(seen.to(memory_format=torch.channels_last)), *truth)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 20.0)
        optimiser.step()
        if step % 50 == 0:
            bar.set_postfix(loss=f"{loss.item():.2f}")
    return network.eval()


def export(network: Network, path: Path) -> None:
    """Write the ONNX file that OpenCV reads."""
    example = torch.zeros(1, 2, SIDE_PX, SIDE_PX)
    names = {"input_names": ["picture"], "output_names": ["hypotheses"]}
    torch.onnx.export(network, (example,), path, dynamo=False, opset_version=13, **names)
