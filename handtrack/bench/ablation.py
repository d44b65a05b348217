"""What each choice is worth: one thing changed at a time.

The importance sampling of the paper runs over the fingers of a clip as in
:mod:`handtrack.bench.comparison` (true palm pose and hand), each time with one choice taken back:
the surface, the silhouette term, the number of basis states, the dimensions of the space.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from handtrack.bench.comparison import Moment, Outcome, moments, run_scheme
from handtrack.fingers.likelihood import LikelihoodSettings
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Capsules, Cardboard, Surface


@dataclass(frozen=True, eq=False)
class Variant:
    """The choices of one run."""

    name: str
    space: ConfigurationSpace
    surface: Callable[[HandShape], Surface] = Capsules
    likelihood: LikelihoodSettings = field(default_factory=LikelihoodSettings)
    samples: int = 100


def variants(space: ConfigurationSpace) -> list[Variant]:
    """The default first, then one choice taken back at a time."""
    default = Variant("default: capsules, xor, 28 states, 7 dimensions", space)
    area = LikelihoodSettings(silhouette="area")
    return [
        default,
        replace(default, name="cardboard for capsules", surface=Cardboard),
        replace(default, name="bare area for overlap", likelihood=area),
        replace(default, name="32 states", space=space.with_basis(32)),
        *(
            replace(default, name=f"{k} dimensions", space=space.with_dims(k))
            for k in (5, 6, 8, 9, 10, 12)
        ),
        replace(default, name="1000 samples", samples=1000),
    ]


def ablate(
    folder: Path, space: ConfigurationSpace, seeds: int, frames: int
) -> Iterator[tuple[str, Outcome]]:
    """Every variant with every seed over the clip in ``folder``."""
    clip, shape = moments(folder, frames)
    chosen = variants(space)
    for variant in chosen[:2]:  # compiles what has to be compiled, so that it is not timed
        _run(variant, 0, clip[:2], shape)
    for variant in chosen:
        for seed in range(seeds):
            yield variant.name, _run(variant, seed, clip, shape)


def _run(variant: Variant, seed: int, clip: Sequence[Moment], shape: HandShape) -> Outcome:
    return run_scheme(
        "paper",
        variant.samples,
        seed,
        clip,
        shape,
        variant.surface(shape),
        variant.space,
        variant.likelihood,
    )
