"""Every script in examples/ runs, on a small clip of its own making, and says something true."""

import re
import runpy
import sys
import tempfile
from pathlib import Path

import pytest

from handtrack import Trajectory

FOLDER = Path(__file__).resolve().parents[1] / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py") if path.name != "sample.py")


@pytest.fixture
def run_script(monkeypatch, tmp_path, tmp_path_factory, capsys):
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path_factory.getbasetemp()))
    monkeypatch.chdir(tmp_path)

    def run(name: str, *arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(FOLDER / name), run_name="__main__")
        return capsys.readouterr().out

    return run


SAYS = {
    "compare.py": r"index_pip_flexion +rms +\d+\.\d\d deg(.|\n)*16 frames known in both",
    "read_tables.py": r"index_pip_flexion_deg(.|\n)*16 of 16 frames tracked",
    "smooth_and_resample.py": r"'smooth 0\.15 s', 'resample to 60 Hz'",
    "stream.py": r"(.* s  tracked    thumb to index +\d+\.\d mm\n){16}",
    "to_blender.py": r"import bpy(.|\n)*export/motion\.bvh",
    "track_and_plot.py": r"16 of 16 frames tracked; index_pip\.png",
}


def test_every_example_is_tried():
    assert sorted(SAYS) == SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_example(name, run_script):
    pytest.importorskip("pandas")
    out = run_script(name)
    assert re.search(SAYS[name], out), out


@pytest.mark.parametrize("name", ["sample.py", *SCRIPTS])
def test_examples_are_short(name):
    assert len((FOLDER / name).read_text().splitlines()) < 40


def test_what_an_example_leaves_is_usable(run_script, tmp_path):
    run_script("smooth_and_resample.py")
    hand = Trajectory.load(tmp_path / "calm.npz")
    assert len(hand) == 31  # 16 frames at 30 a second, ends included
    run_script("track_and_plot.py")
    assert (tmp_path / "index_pip.png").read_bytes()[:4] == b"\x89PNG"


def test_an_example_takes_a_path(run_script):
    import sample

    out = run_script("compare.py", sample.run(), sample.run())
    assert set(re.findall(r"rms +(\S+) deg", out)) == {"0.00"}
