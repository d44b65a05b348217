"""``python -m handtrack.bench.training``."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from handtrack.bench.training import facing_cue, proposer, shape_cue
from handtrack.bench.training.train import TrainingSettings, rendered


@dataclass(frozen=True)
class Proposer:
    """Train the proposer's network and write it."""

    out: Path
    """The ONNX file; the shipped one is ``handtrack/proposer/proposer.onnx``."""
    cache: Path = Path("pictures.npz")
    """Where rendered pictures are kept."""
    settings: TrainingSettings = proposer.SHIPPED

    def __call__(self) -> None:
        """Render or take the pictures, train, write."""
        s = self.settings
        proposer.write(proposer.trained(rendered(s.pictures, s.seed, self.cache), s), self.out)


@dataclass(frozen=True)
class FacingCue:
    """Train the network of the facing cue and write it."""

    out: Path
    """The ONNX file; the shipped one is ``handtrack/proposer/facing_cue.onnx``."""
    cache: Path = Path("pictures.npz")
    """Where rendered pictures are kept."""
    settings: TrainingSettings = facing_cue.SHIPPED

    def __call__(self) -> None:
        """Render or take the pictures, train, write."""
        s = self.settings
        facing_cue.write(facing_cue.trained(rendered(s.pictures, s.seed, self.cache), s), self.out)


@dataclass(frozen=True)
class ShapeCue:
    """Train the network of the shape cue and write it."""

    out: Path
    """The ONNX file; the shipped one is ``handtrack/evidence/shape_cue.onnx``."""
    photos: Path
    """A folder of photographs of anything but hands."""
    people: Path | None = None
    """A folder of photographs of people without their hands."""
    cache: Path = Path("pictures.npz")
    """Where rendered pictures are kept."""
    settings: TrainingSettings = shape_cue.SHIPPED

    def __call__(self) -> None:
        """Render or take the pictures, draw what is behind them, train, write."""
        s = self.settings
        taught = rendered(s.pictures, s.seed, self.cache)
        grounds = shape_cue.some_grounds(self.photos, self.people, s.seed)
        shape_cue.write(shape_cue.trained(taught, grounds, s), self.out)


if __name__ == "__main__":
    tyro.cli(Proposer | ShapeCue | FacingCue, prog="python -m handtrack.bench.training")()
