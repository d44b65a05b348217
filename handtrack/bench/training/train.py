"""Render pictures and train a network on them: ``python -m handtrack.bench.training``.

Needs PyTorch, which nothing else here does (``pip install handtrack[training]``).
"""

import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from functools import partial
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from handtrack.bench.training import people
from synth.pictures import Picture, pictures

AHEAD = 6
#: Pictures that one process renders at a time.
AT_ONCE = 300
#: Share of them that are of ``synth``'s own hands, where there are others.
_OURS = 0.5
_WARM_UP = 200
_STEEPEST = 20.0

AnyNetwork = TypeVar("AnyNetwork", bound=nn.Module)
#: What a batch is: what is seen, then the truth.
Batch = list[Tensor]


@dataclass(frozen=True)
class TrainingSettings:
    """How much is learned, and how fast."""

    pictures: int
    """Rendered pictures, each of which gives another lesson every time."""
    steps: int
    """Batches that are learned from."""
    rate: float
    """Highest learning rate; it falls along a cosine."""
    batch: int
    """Lessons in a step."""
    decay: float = 1e-2
    """Weight decay (AdamW)."""
    seed: int = 0
    """Seed of pictures, lessons and first weights."""


def rendered(count: int, seed: int, cache: Path, makehuman: Path | None = None) -> list[Picture]:
    """Pictures, kept in ``cache`` (an ``.npz``) and taken from there if they are.

    ``makehuman`` is the folder of MakeHuman's data, if half of the hands are to be its people's.
    """
    if cache.exists():
        with np.load(cache, allow_pickle=False) as data:
            columns = {name: data[name] for name in data.files}
        return [
            Picture(**{name: column[k] for name, column in columns.items()})
            for k in range(len(columns["focal_px"]))
        ]
    made = in_processes(partial(_some_pictures, makehuman), count, AT_ONCE, seed)
    columns = {f.name: np.array([getattr(p, f.name) for p in made]) for f in fields(Picture)}
    np.savez(cache, allow_pickle=False, **columns)
    return made


def in_processes(
    make: Callable[[np.random.SeedSequence], list], count: int, at_once: int, seed: int
) -> list:
    """``count`` things that processes make, ``at_once`` from one seed."""
    seeds = np.random.SeedSequence(seed).spawn(-(-count // at_once))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        parts = tqdm(pool.map(make, seeds), total=len(seeds), unit=f"{at_once} pictures")
        return [one for part in parts for one in part][:count]


def _some_pictures(makehuman: Path | None, seed: np.random.SeedSequence) -> list[Picture]:
    rng = np.random.default_rng(seed)
    source = pictures(rng)
    if makehuman is not None and rng.random() > _OURS:
        source = people.pictures(makehuman, rng)
    return list(islice(source, AT_ONCE))


def batches(draw: Callable[[np.random.Generator], Batch], seed: int) -> Iterator[Batch]:
    """What ``draw`` gives, without end, made beside the training."""
    rng = np.random.default_rng(seed)
    waiting: queue.Queue[Batch] = queue.Queue(AHEAD)

    def teach() -> None:
        while True:
            waiting.put(draw(rng))

    threading.Thread(target=teach, daemon=True).start()
    while True:
        yield waiting.get()


def train(
    network: AnyNetwork,
    draw: Callable[[np.random.Generator], Batch],
    loss_of: Callable[..., Tensor],
    settings: TrainingSettings,
) -> AnyNetwork:
    """The network, after it has learned from batches that ``draw`` gives.

    ``loss_of(answer, *truth)`` is minimised.
    """
    cv2.setNumThreads(1)  # pictures are small
    network = network.train().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=settings.decay)
    source = batches(draw, settings.seed)
    bar = tqdm(range(settings.steps), unit="step")
    for step in bar:
        share = step / settings.steps
        rate = settings.rate * (0.5 + 0.5 * np.cos(np.pi * share) + 0.01)
        optimiser.param_groups[0]["lr"] = rate * min(1.0, step / _WARM_UP)
        seen, *truth = next(source)
        loss = loss_of(network(seen.to(memory_format=torch.channels_last)), *truth)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _STEEPEST)
        optimiser.step()
        if step % 50 == 0:
            bar.set_postfix(loss=f"{loss.item():.2f}")
    return network.eval()


def export(network: nn.Module, example: Tensor, path: Path, sizes: tuple[str, ...] = ()) -> None:
    """Write the ONNX file that OpenCV reads.

    ``sizes`` name the axes of the example's picture, if they may be of any size.
    """
    axes = {"seen": dict(enumerate(sizes, 2))} if sizes else None
    names = {"input_names": ["seen"], "output_names": ["answer"], "dynamic_axes": axes}
    torch.onnx.export(network, (example,), path, dynamo=False, opset_version=13, **names)
