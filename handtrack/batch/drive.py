"""Handing the jobs of a batch out, here or to a cluster, and taking what came of them.

Both are an executor, so there is one loop. A stop is a file in the work folder, which the jobs look
at wherever they run; those that have not begun then end before they do anything.
"""

import shutil
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from handtrack.batch.job import LOOK_S, STOP, Job, conclude, run_job
from handtrack.batch.status import ClipStatus, State
from handtrack.errors import HandtrackError
from handtrack.stop import StopAsked

Outcome = tuple[ClipStatus, bool]


@contextmanager
def work_folder(path: Path) -> Iterator[None]:
    """A folder for what is not yet whole; what dead batches left beside it goes, and it goes too.

    The caller holds the lock of the folder around it.
    """
    for left in path.parent.iterdir():
        if left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
    path.mkdir()
    try:
        yield
    finally:
        shutil.rmtree(path, ignore_errors=True)


def do_all(
    jobs: Sequence[Job], executor: Executor, asked: StopAsked, quiet: bool
) -> dict[str, Outcome]:
    """The outcome of every job by its name, and whether it is new; a stop leaves them early."""
    futures = {executor.submit(run_job, job): job for job in jobs}
    outcomes: dict[str, Outcome] = {}
    left = set(futures)
    off = quiet or not sys.stderr.isatty()
    with tqdm(total=len(jobs), unit="clip", disable=off) as bar:
        while left:
            done, left = wait(left, timeout=LOOK_S, return_when=FIRST_COMPLETED)
            for future in done:
                outcomes[futures[future].name] = _outcome(future, futures[future])
                bar.update()
            if asked:
                (jobs[0].work / STOP).touch()
    return {job.name: outcomes[job.name] for job in jobs}


def _outcome(future: "Future[Outcome]", job: Job) -> Outcome:
    """What a job returned; if it did not come back, that is its outcome."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:
        text = " ".join(str(error).split()) or "the cluster is gone, or gave it up"
        line = f"{text} ({type(error).__name__})"
        code = HandtrackError.exit_code
        return conclude(job, job.status(State.FAILED, exit_code=code, last_line=line)), True
