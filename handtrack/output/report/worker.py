"""A thread that does jobs one after another; few may wait, so whoever is faster is held up."""

import queue
import threading
from collections.abc import Callable

#: Jobs that may wait.
N_WAITING = 4


class Worker:
    """Runs jobs in their order; the first fault is raised by the next call and ends the work."""

    def __init__(self, name: str) -> None:
        self._jobs: queue.Queue[Callable[[], None] | None] = queue.Queue(maxsize=N_WAITING)
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def put(self, job: Callable[[], None]) -> None:
        """Queue a job."""
        self.raise_fault()
        self._jobs.put(job)

    def close(self) -> None:
        """Do what waits, then stop; faults are not raised here."""
        self._jobs.put(None)
        self._thread.join()

    def raise_fault(self) -> None:
        """Raise what a job raised."""
        if self._fault is not None:
            raise self._fault

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            if self._fault is None:
                try:
                    job()
                except Exception as fault:
                    self._fault = fault
