"""Fixtures that every test may ask for."""

import os
from pathlib import Path

import pytest

# one thread each: the tests share the machine, and results must not depend on how many there are
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of recordings that is laid beside the checkout and never committed."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not (folder / "clips").is_dir():
        pytest.skip(f"no recordings at {folder}: this test needs them")
    return folder
