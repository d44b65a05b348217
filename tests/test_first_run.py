"""The word about compiling, to people who wait and to nobody else."""

import io
import sys
import time

import pytest
from tqdm import tqdm

from handtrack import first_run


@pytest.mark.parametrize(("done", "disable"), [(0, False), (1, False), (0, True)])
def test_word_comes_only_if_nothing_is_done_and_somebody_looks(done, disable, monkeypatch):
    said = io.StringIO()
    monkeypatch.setattr(first_run, "PATIENCE_S", 0.05)
    monkeypatch.setattr(sys, "stderr", said)
    with tqdm(total=3, disable=disable, file=io.StringIO()) as bar, first_run.word_if_slow(bar):
        bar.update(done)
        time.sleep(0.3)
    assert (first_run.WORD in said.getvalue()) == (not done and not disable)
