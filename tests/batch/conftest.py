"""Six tiny clips of which one is broken, and the tables that they give one by one."""

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from handtrack.run import RunSettings, run_clip
from synth.clip import write_clip
from synth.scene import Scene

#: Frames of the clips: the first is long enough to be met in the middle; "c" and "d" show no palm
#: that is open enough, and their side is told at the second try, five frames on.
N_FRAMES = {"long": 60, "b": 10, "c": 12, "d": 12, "ä e": 10}
TABLES = ("angles.csv", "keypoints.csv")


@dataclass(frozen=True)
class Clips:
    paths: list[Path]
    tables: dict[str, list[bytes]]  # by stem; the broken clip has none


def make_clip(folder, stem, n_frames, seed):
    """A film of the cardboard hand, which needs no OpenGL."""
    scene = Scene(seed=seed, surface="cardboard", width_px=240, height_px=180, focal_px=225.0)
    scene = replace(scene, motion=replace(scene.motion, frames=n_frames))
    write_clip(scene, folder / f"{stem}.made", progress=False)
    return (folder / f"{stem}.made" / "clip.mp4").rename(folder / f"{stem}.mp4")


def tables_in(folder):
    return [(folder / name).read_bytes() for name in TABLES]


@pytest.fixture(scope="session")
def clips(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clips")
    paths = [make_clip(folder, stem, n, k) for k, (stem, n) in enumerate(N_FRAMES.items())]
    tables = {}
    for path in paths:
        out = folder / "alone" / path.stem
        assert run_clip(RunSettings(path, out, overlay=False, report=False)).counts.tracked > 5
        tables[path.stem] = tables_in(out)
    assert len({table for tables_of_one in tables.values() for table in tables_of_one}) == 10
    (folder / "broken.mp4").write_bytes(paths[1].read_bytes()[:3000])
    return Clips([*paths, folder / "broken.mp4"], tables)


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text("overlay = false\nreport = false\n")
    return path
