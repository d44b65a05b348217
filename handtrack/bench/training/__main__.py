"""``python -m handtrack.bench.training``."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from handtrack.bench.training.train import TrainingSettings, export, rendered, train


@dataclass(frozen=True)
class Training:
    """Train the proposer's network and write it."""

    out: Path
    """The ONNX file; the shipped one is ``handtrack/proposer/proposer.onnx``."""
    cache: Path = Path("pictures.npz")
    """Where rendered pictures are kept."""
    settings: TrainingSettings = field(default_factory=TrainingSettings)

    def __call__(self) -> None:
        """Render or take the pictures, train, write."""
        s = self.settings
        export(train(rendered(s.pictures, s.seed, self.cache), s), self.out)


if __name__ == "__main__":
    tyro.cli(Training, prog="python -m handtrack.bench.training")()
