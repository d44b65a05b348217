"""``handtrack batch``: many clips, each in a process of its own."""

from concurrent.futures import ThreadPoolExecutor as Threads
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from handtrack.batch.cluster import cluster_executor
from handtrack.batch.drive import do_all, work_folder
from handtrack.batch.lock import only_one
from handtrack.batch.plan import WORK, make_jobs
from handtrack.batch.summary import exit_code, sentence, table
from handtrack.errors import InputError
from handtrack.output.files import output_folder
from handtrack.stop import stop_signals


@dataclass(frozen=True)
class Batch:
    """Follow the hands in many clips: a folder and a status file for each.

    A clip that was finished with the same content, settings and version is not done again, so
    after a stop the same command goes on. A clip that fails never stops the others. Exit code: 0
    all complete, 2 bad input, 3 cannot write, 5 all done but some frames could not be decoded, 6
    some clip has no result, 130 interrupted.
    """

    clips: tyro.conf.Positional[tuple[Path, ...]]
    """Video files."""
    out: Path
    """Folder for the results: <clip>/ and <clip>.status.json."""
    jobs: int = 1
    """Clips at the same time, one thread of work each; a cluster decides by itself."""
    scheduler: str | None = None
    """Address of a Dask scheduler (tcp://host:8786) whose workers do the work."""
    run_config: Annotated[Path | None, tyro.conf.arg(name="config")] = None
    """A TOML file with options of 'handtrack run', the same for all clips."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Do what is to do, print the table, return the exit code."""
        if self.jobs < 1:
            raise InputError(f"--jobs {self.jobs}: at least one is needed")
        jobs = make_jobs(self.clips, self.out, self.run_config)
        with cluster_executor(self.scheduler) if self.scheduler else Threads(self.jobs) as executor:
            output_folder(self.out)
            with only_one(jobs[0].out / WORK), work_folder(jobs[0].work), stop_signals() as asked:
                outcomes = do_all(jobs, executor, asked, self.quiet)
        print(table(outcomes))
        print(sentence(list(outcomes.values()), self.out))
        return exit_code([status for status, _ in outcomes.values()])
