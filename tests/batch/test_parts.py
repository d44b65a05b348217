"""The parts of a batch: names, settings, status files, publishing, and what is refused."""

from dataclasses import replace
from pathlib import Path

import pytest

from handtrack.batch import cluster
from handtrack.batch.commands import Batch
from handtrack.batch.job import conclude, publish, run_job
from handtrack.batch.lock import only_one
from handtrack.batch.names import folder_names
from handtrack.batch.plan import WORK, make_jobs, run_options
from handtrack.batch.status import ClipStatus, State, read_status, write_status
from handtrack.batch.summary import exit_code
from handtrack.errors import InputError, OutputError


def status(state=State.COMPLETE, code=0, **known):
    return ClipStatus("/clips/a.mp4", state, exit_code=code, **known)


def test_clips_of_one_stem_get_folders_of_their_own(tmp_path):
    one, two, three = Path("/x/hand.mp4"), Path("/y/hand.avi"), Path("/z/Hand.mp4")
    names = folder_names([one, two, three], tmp_path)
    assert names[one] == "hand"
    assert len({name.casefold() for name in names.values()}) == 3
    assert names[two].startswith("hand-")


def test_a_clip_keeps_its_folder_whatever_comes_with_it_later(tmp_path):
    one, two = Path("/x/hand.mp4"), Path("/y/hand.mp4")
    first = folder_names([one, two], tmp_path)
    for clip, name in first.items():
        write_status(tmp_path / f"{name}.status.json", replace(status(), clip=str(clip)))
    assert folder_names([two, one], tmp_path) == first
    assert folder_names([two], tmp_path) == {two: first[two]}


def test_a_folder_that_is_not_of_a_batch_is_left_alone(tmp_path):
    (tmp_path / "hand").mkdir()
    name = folder_names([Path("/x/hand.mp4")], tmp_path)[Path("/x/hand.mp4")]
    assert name != "hand"
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match=f"{name}: is there and not of this batch"):
        folder_names([Path("/x/hand.mp4")], tmp_path)


def test_the_same_clip_twice_is_one_job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jobs = make_jobs([Path("a.mp4"), tmp_path / "a.mp4"], tmp_path / "out", None)
    assert [job.clip for job in jobs] == [tmp_path / "a.mp4"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sid = 'left'", "unknown key 'sid' .did you mean 'side'"),
        ("side = 'up'", "'right', 'left'"),
        ("seed = -1", "--seed -1 is negative"),
        ("out = 'here'", "'out' is no option in a batch"),
        ("debug-frames = [1]", "'debug-frames' is no option in a batch"),
        ("hand = 'none.toml'", r"none\.toml: cannot be read \(no such file\)"),
    ],
)
def test_settings_are_refused_before_anything_is_written(text, says, tmp_path):
    (tmp_path / "run.toml").write_text(text)
    with pytest.raises(InputError, match=says):
        Batch((tmp_path / "a.mp4",), tmp_path / "out", run_config=tmp_path / "run.toml")()
    assert not (tmp_path / "out").exists()


def test_files_in_the_settings_count_by_content_and_are_seen_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("run.toml").write_text("hand = 'hand.toml'\nside = 'left'\n")
    Path("hand.toml").write_text("one")
    flags, before = run_options(Path("run.toml"))
    assert flags == (f"--hand={tmp_path / 'hand.toml'}", "--side=left")
    Path("hand.toml").write_text("two")
    assert run_options(Path("run.toml"))[1] != before
    Path("hand.toml").write_text("one")
    assert run_options(Path("run.toml"))[1] == before


@pytest.mark.parametrize(
    ("statuses", "code"),
    [
        ([status()], 0),
        ([status(), status(code=5)], 5),
        ([status(), status(code=4), status(code=5)], 6),
        ([status(), status(State.FAILED, 2)], 6),
        ([status(State.FAILED, 2), status(State.INTERRUPTED, 130)], 130),
    ],
)
def test_exit_code(statuses, code):
    assert exit_code(statuses) == code


def test_status_file_comes_back_as_it_was(tmp_path):
    written = status(input={"sha256": "00"}, settings={"seed": 1}, version="1.2", files={"a": 3})
    write_status(tmp_path / "a.status.json", written)
    assert read_status(tmp_path / "a.status.json") == written
    assert read_status(tmp_path / "none.status.json") is None


@pytest.mark.parametrize("text", ["", "[]", '{"format": "other"}', '{"format": "x", "version": 1}'])
def test_foreign_status_file_is_refused_by_name(text, tmp_path):
    (tmp_path / "a.status.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.status\.json"):
        read_status(tmp_path / "a.status.json")


def write_files(folder, **texts):
    folder.mkdir(parents=True)
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


def test_publishing_over_an_earlier_result_takes_away_what_is_stale_and_nothing_else(tmp_path):
    folder = write_files(tmp_path / "a", angles="old", film="old", notes="mine")
    publish(write_files(tmp_path / "made", angles="new", run="new"), folder, stale={"film"})
    found = {path.name: path.read_text() for path in folder.iterdir()}
    assert found == {"angles": "new", "run": "new", "notes": "mine"}


def make_job(tmp_path, **changes):
    [job] = make_jobs([tmp_path / "a.mp4"], tmp_path / "out", None)
    job.work.mkdir(parents=True)
    return replace(job, **changes)


def test_failure_does_not_hide_what_another_attempt_finished(tmp_path):
    job = make_job(tmp_path)
    write_files(job.folder, angles="12345")
    done = job.status(State.COMPLETE, input={"sha256": "00"}, exit_code=0, files={"angles": 5})
    write_status(job.status_path, done)
    failed = job.status(State.FAILED, input={"sha256": "00"}, exit_code=-9)
    conclude(job, failed)
    assert read_status(job.status_path) == done
    conclude(job, replace(failed, input={"sha256": "11"}))
    assert read_status(job.status_path).state is State.FAILED


def test_worker_that_does_not_see_the_folder_says_so(tmp_path):
    outcome, _ = run_job(make_job(tmp_path, work=tmp_path / "elsewhere"))
    assert outcome.state is State.FAILED
    assert "workers must share that folder" in outcome.last_line


def test_nothing_begins_after_a_stop(tmp_path):
    job = make_job(tmp_path)
    (job.work / "stop").touch()
    assert run_job(job)[0].state is State.INTERRUPTED
    assert not job.status_path.exists()


def test_two_batches_in_one_folder_are_refused(tmp_path):
    with only_one(tmp_path / "out" / WORK), pytest.raises(OutputError, match="another batch"):
        Batch((tmp_path / "a.mp4",), tmp_path / "out")()
    assert Batch((tmp_path / "a.mp4",), tmp_path / "out")() == 6


def test_cluster_that_does_not_answer_is_one_line(tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="needs handtrack[dask]")
    monkeypatch.setattr(cluster, "ANSWER_S", 0.3)
    with pytest.raises(InputError, match="no Dask scheduler answers there"):
        Batch((tmp_path / "a.mp4",), tmp_path / "out", scheduler="tcp://127.0.0.1:9")()
    with pytest.raises(InputError, match="no Dask scheduler answers there"):
        Batch((tmp_path / "a.mp4",), tmp_path / "out", scheduler="what://is:this")()
    assert not (tmp_path / "out").exists()


def test_missing_dask_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'handtrack\[dask\]'"):
        Batch((tmp_path / "a.mp4",), tmp_path / "out", scheduler="tcp://127.0.0.1:9")()


@pytest.mark.parametrize(
    ("settings", "says"), [({"clips": ()}, "no clips"), ({"jobs": 0}, "--jobs 0")]
)
def test_nothing_to_do_is_refused(settings, says, tmp_path):
    given = {"clips": (tmp_path / "a.mp4",), "out": tmp_path / "out"}
    with pytest.raises(InputError, match=says):
        Batch(**given | settings)()
