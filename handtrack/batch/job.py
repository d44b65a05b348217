"""One clip of a batch: run in a process of its own, its results put in place whole.

The same function does it here and on a worker of a cluster. It may be called twice for one clip,
one after the other or even at the same time (a worker that was given up for dead may still
live), and the outcome is that of one call::

    status    finished with this very input and these settings? then there is nothing to do
    private   run into a folder that nobody else knows
    publish   rename it to its place; equal input and settings gave equal tables
    status    say so

Nothing is in its place before it is whole, and a status says "complete" only after that.
"""

import os
import shutil
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from handtrack.batch.status import SUFFIX, ClipStatus, State, digest_of, read_status, write_status
from handtrack.errors import (
    EXIT_INTERRUPTED,
    EXIT_SOME_UNDECODABLE,
    HandtrackError,
    NothingUsableError,
)
from handtrack.output.provenance import read_provenance

#: Exit codes of a run that went through the whole clip: trying again would change nothing.
FINISHED = (0, NothingUsableError.exit_code, EXIT_SOME_UNDECODABLE)
#: One thread for every library that would take more.
ONE_THREAD = dict.fromkeys(
    (
        *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
        *("VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"),
    ),
    "1",
)
#: A file of this name in the work folder asks all runs of a batch to stop.
STOP = "stop"
#: How often a run is looked at, and how long it may take to stop.
LOOK_S, STOP_S = 0.2, 20.0


@dataclass(frozen=True)
class Job:
    """A clip and where it goes.

    Parameters
    ----------
    clip : Path
        Absolute.
    out : Path
        Folder of the batch, absolute.
    name : str
        Of the clip's folder in it.
    flags : tuple of str
        Options of ``handtrack run``.
    settings : dict
        What they mean, as the status file has it.
    version : str
        Of handtrack.
    work : Path
        Folder for what is not yet whole, on the same disk as ``out``.
    """

    clip: Path
    out: Path
    name: str
    flags: tuple[str, ...]
    settings: dict[str, Any]
    version: str
    work: Path

    @property
    def folder(self) -> Path:
        """Where the results go."""
        return self.out / self.name

    @property
    def status_path(self) -> Path:
        """Where the status goes."""
        return self.out / f"{self.name}{SUFFIX}"

    @property
    def stop_is_asked(self) -> bool:
        """Whether the batch is over: somebody asked for a stop, or its work folder is gone."""
        return (self.work / STOP).exists() or not self.work.exists()

    def status(self, state: State, **known: Any) -> ClipStatus:
        """A status of this clip."""
        return ClipStatus(
            str(self.clip),
            state,
            settings=self.settings,
            version=self.version,
            worker=f"{socket.gethostname()} {os.getpid()}",
            **known,
        )


def run_job(job: Job) -> tuple[ClipStatus, bool]:
    """Do a clip unless it is done.

    Returns
    -------
    status : ClipStatus
        What came of it; what went wrong is in there and never raised.
    is_new : bool
        False if all of it was there already.
    """
    if not job.work.is_dir():
        line = f"{socket.gethostname()} does not see {job.work}: workers must share that folder"
        return job.status(State.FAILED, last_line=line), True
    if job.stop_is_asked:
        return job.status(State.INTERRUPTED, last_line="not begun"), True
    try:
        begun = job.status(State.RUNNING, input=digest_of(job.clip))
        before = read_status(job.status_path)
        if before is not None and _is_done(before, begun, job):
            return before, False
        if before is not None:
            again = before.state is State.RUNNING and before.is_of(begun)
            attempts = before.attempts + 1 if again else 1
            begun = replace(begun, files=before.files, attempts=attempts)
        write_status(job.status_path, begun)
        return conclude(job, _run(job, begun)), True
    except (HandtrackError, OSError) as error:
        line = " ".join(str(error).split())
        code = getattr(error, "exit_code", HandtrackError.exit_code)
        return conclude(job, job.status(State.FAILED, exit_code=code, last_line=line)), True


def _is_done(before: ClipStatus, begun: ClipStatus, job: Job) -> bool:
    """Whether all of this was done before, and is still there."""
    return before.is_finished and before.is_of(begun) and before.results_are_in(job.folder)


def conclude(job: Job, status: ClipStatus) -> ClipStatus:
    """Write the status, unless this attempt failed where another one succeeded meanwhile."""
    try:
        now = read_status(job.status_path)
        if status.is_finished or now is None or not _is_done(now, status, job):
            write_status(job.status_path, status)
    except HandtrackError as error:
        return replace(status, state=State.FAILED, last_line=str(error), exit_code=error.exit_code)
    return status


def _run(job: Job, begun: ClipStatus) -> ClipStatus:
    """Run into a private folder and put what came of it in its place."""
    begin = time.monotonic()
    attempt = job.work / uuid.uuid4().hex
    attempt.mkdir()
    try:
        code, line = _in_a_process(job, attempt)
        status = replace(
            begun,
            state=_state_of(code),
            exit_code=code,
            last_line=line,
            seconds=round(time.monotonic() - begin, 2),
        )
        if not status.is_finished:
            return status
        made = attempt / job.name
        counts = read_provenance(made)["counts"]
        files = {str(p.relative_to(made)): p.stat().st_size for p in _files_in(made)}
        publish(made, job.folder, stale=set(begun.files) - set(files))
        return replace(status, counts=counts, files=files)
    finally:
        shutil.rmtree(attempt, ignore_errors=True)


def publish(made: Path, folder: Path, stale: set[str]) -> None:
    """Put the files of ``made`` in ``folder``, in one step where there is none yet.

    Files that somebody laid there stay; of an earlier result, the ``stale`` ones go.
    """
    if not folder.exists():
        try:
            os.rename(made, folder)
            return
        except OSError:
            if not folder.exists():
                raise  # else another attempt was faster: its files are equal to ours
    for path in _files_in(made):
        target = folder / path.relative_to(made)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, target)
    for name in stale:
        (folder / name).unlink(missing_ok=True)


def _files_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _state_of(code: int) -> State:
    if code in FINISHED:
        return State.COMPLETE
    return State.INTERRUPTED if code == EXIT_INTERRUPTED else State.FAILED


def _in_a_process(job: Job, attempt: Path) -> tuple[int, str]:
    """Exit code and last line of ``handtrack run`` in a process of its own."""
    # the name alone, seen from where it runs: what it writes does not tell the private folder
    command = [sys.executable, "-m", "handtrack.batch.child", "run", str(job.clip)]
    command += ["--out", job.name, "--quiet", *job.flags]
    with _held_pipe() as our_end_holds:
        process = subprocess.Popen(
            command,
            cwd=attempt,
            env=os.environ | ONE_THREAD | {"PYTHONPATH": _import_path()},
            stdin=our_end_holds,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,  # Ctrl-C is for the batch, which hands it on
        )
        try:
            out, err = _watched(process, job)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
    if process.returncode not in FINISHED and job.stop_is_asked:
        return EXIT_INTERRUPTED, "stopped"
    return process.returncode, _last_line(process.returncode, out, err)


def _watched(process: "subprocess.Popen[str]", job: Job) -> tuple[str, str]:
    """What the process says until it ends; it is stopped when the batch is."""
    deadline: float | None = None
    while True:
        try:
            return process.communicate(timeout=LOOK_S)
        except subprocess.TimeoutExpired:
            if deadline is None and job.stop_is_asked:
                process.terminate()
                deadline = time.monotonic() + STOP_S
            elif deadline is not None and time.monotonic() > deadline:
                process.kill()


@contextmanager
def _held_pipe() -> Iterator[int]:
    """The reading end of a pipe that stays open and silent as long as this process lives."""
    reading, writing = os.pipe()
    try:
        yield reading
    finally:
        os.close(writing)
        os.close(reading)


def _import_path() -> str:
    """Where this process imports from, for one that starts in another folder."""
    return os.pathsep.join(os.path.abspath(path) for path in sys.path)


def _last_line(code: int, out: str, err: str) -> str:
    """The line that says what came of it."""
    if code < 0:
        return f"ended by signal {-code}" + (f": {err.split(chr(10))[0]}" if err.strip() else "")
    spoken = out.strip() if code in (*FINISHED, EXIT_INTERRUPTED) else err.strip()
    lines = (spoken or err.strip() or out.strip()).splitlines() or ["it said nothing"]
    return lines[-1].removeprefix("handtrack: ")
