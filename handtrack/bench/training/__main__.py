"""``python -m handtrack.bench.training``."""

from pathlib import Path

import tyro

from handtrack.bench.training.train import TrainingSettings, export, rendered, train


def main(
    out: Path, cache: Path = Path("pictures.npz"), settings: TrainingSettings | None = None
) -> None:
    """Train the proposer's network and write it.

    Parameters
    ----------
    out
        The ONNX file; the shipped one is ``handtrack/proposer/proposer.onnx``.
    cache
        Where rendered pictures are kept.
    settings
        How.
    """
    settings = settings or TrainingSettings()
    export(train(rendered(settings.pictures, settings.seed, cache), settings), out)


if __name__ == "__main__":
    tyro.cli(main)
