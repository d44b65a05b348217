"""Many clips at once: the results of each alone, whatever happens to the others."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from handtrack import cli
from handtrack.batch.commands import Batch
from handtrack.batch.status import State, read_status

from .conftest import tables_in


def status_of(out, name):
    return read_status(out / f"{name}.status.json")


def wait_for(is_so, what, seconds=30):
    end = time.monotonic() + seconds
    while not (found := is_so()):
        assert time.monotonic() < end, f"no {what} in {seconds} s"
        time.sleep(0.05)
    return found


def is_running(out, name):
    path = out / f"{name}.status.json"
    return path.exists() and status_of(out, name).state is State.RUNNING


def runs_below(process):
    """The processes of runs that this process and its children have started."""
    below = psutil.Process(process).children(recursive=True)
    return [p for p in below if "handtrack.batch.child" in p.cmdline()]


def check_all(clips, out):
    """Everything as one by one, nothing lost and nothing left over."""
    for path in clips.paths[:-1]:
        assert status_of(out, path.stem).state is State.COMPLETE
        assert tables_in(out / path.stem) == clips.tables[path.stem], path.stem
    broken = status_of(out, "broken")
    assert (broken.state, broken.exit_code) == (State.FAILED, 2)
    assert "broken.mp4: not a video" in broken.last_line
    stems = [path.stem for path in clips.paths]
    expected = [".batch", *stems[:-1], *(f"{stem}.status.json" for stem in stems)]
    assert sorted(p.name for p in out.iterdir()) == sorted(expected)
    assert [p.name for p in (out / ".batch").iterdir()] == ["lock"]


@pytest.mark.slow
def test_two_processes_give_what_one_by_one_gives(clips, config, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = [*map(str, clips.paths), "--out", str(out), "--config", str(config), "--jobs", "2"]
    assert cli.main(["batch", *arguments]) == 6
    check_all(clips, out)
    said, err = capsys.readouterr()
    assert err == ""
    assert (
        said.splitlines()[-1]
        == f"6 clips: 5 done, 0 done before, 1 without result; results in {out}"
    )
    [line] = [line for line in said.splitlines() if line.startswith("broken")]
    assert "failed" in line
    assert "not a video" in line
    record = json.loads((out / "b" / "run.json").read_text())
    assert (record["settings"]["out"], record["settings"]["overlay"]) == ("b", False)
    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.csv")}
    assert cli.main(["batch", *arguments]) == 6
    assert "0 done, 5 done before, 1 without" in capsys.readouterr().out
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*.csv")} == before


@pytest.mark.slow
def test_cluster_whose_worker_is_killed_gives_the_same(clips, config, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs handtrack[dask]")
    out = tmp_path / "out"
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True}
    with distributed.LocalCluster(**options, dashboard_address=None) as cluster:
        batch = Batch(
            tuple(clips.paths), out, scheduler=cluster.scheduler_address, run_config=config
        )
        codes = []
        thread = threading.Thread(target=lambda: codes.append(batch()))
        thread.start()
        wait_for(lambda: is_running(out, "long"), "running clip")
        [run] = [
            p for p in wait_for(lambda: runs_below(os.getpid()), "run") if "long" in p.cmdline()
        ]
        killed = int(status_of(out, "long").worker.split()[-1])
        assert run.ppid() == killed
        os.kill(killed, signal.SIGKILL)
        run.wait(20)  # the run of the dead worker ends too
        thread.join(60)
    assert codes == [6]
    check_all(clips, out)
    attempts = {path.stem: status_of(out, path.stem).attempts for path in clips.paths}
    assert attempts == {**dict.fromkeys(attempts, 1), "long": 2}
    assert int(status_of(out, "long").worker.split()[-1]) != killed


def test_finished_clip_is_done_again_only_if_something_changed(clips, tmp_path, capsys):
    clip = tmp_path / "a.mp4"
    clip.write_bytes(clips.paths[1].read_bytes())
    config, out = tmp_path / "run.toml", tmp_path / "out"

    def done_now(text="overlay = false\n"):
        config.write_text(text)
        assert Batch((clip,), out, run_config=config)() == 0
        return "1 done, 0 done before" in capsys.readouterr().out

    assert done_now()
    assert not done_now()
    assert not done_now("# the same\noverlay=false\nseed = 0\n")
    (out / "a" / "notes.txt").write_text("mine")
    (out / "a" / "angles.csv").unlink()
    assert done_now("overlay = false\nseed = 3\n")
    assert (out / "a" / "notes.txt").read_text() == "mine"
    clip.write_bytes(clips.paths[2].read_bytes())
    assert done_now()
    assert tables_in(out / "a") == clips.tables["c"]


def test_killed_run_stops_no_other(clips, config, tmp_path):
    out, codes = tmp_path / "out", []
    batch = Batch((clips.paths[0], clips.paths[1]), out, jobs=2, run_config=config)
    thread = threading.Thread(target=lambda: codes.append(batch()))
    thread.start()
    wait_for(lambda: is_running(out, "long"), "running clip")
    [run] = wait_for(
        lambda: [p for p in runs_below(os.getpid()) if "long" in p.cmdline()], "run of its own"
    )
    run.kill()
    thread.join(30)
    assert codes == [6]
    assert status_of(out, "long").last_line == "ended by signal 9"
    assert status_of(out, "long").exit_code == -9
    assert not (out / "long").exists()
    assert tables_in(out / "b") == clips.tables["b"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_end_of_the_batch_ends_its_runs_and_keeps_what_is_finished(number, clips, config, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "handtrack", "batch", "--out", str(out)]
    command += ["--config", str(config), str(clips.paths[1]), str(clips.paths[0])]
    with subprocess.Popen(
        [*command, str(clips.paths[2])], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        wait_for(lambda: is_running(out, "long"), "running clip")
        [run] = wait_for(lambda: runs_below(process.pid), "run")
        process.send_signal(number)
        said, err = process.communicate(timeout=30)
        run.wait(20)
    assert tables_in(out / "b") == clips.tables["b"]
    assert not (out / "long").exists()
    assert not (out / "c").exists()
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert err == ""
        assert "3 clips: 1 done, 0 done before, 2 without result" in said
        assert status_of(out, "long").state is State.INTERRUPTED
        assert [p.name for p in (out / ".batch").iterdir()] == ["lock"]
