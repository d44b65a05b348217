"""A Dask cluster that is already there, as an executor; ``pip install 'handtrack[dask]'``.

Every worker must see the folder of the clips and the folder of the results under the same path,
and have the same handtrack installed. A task whose worker dies is given to another by the
scheduler; a task that kills three workers is given up (Dask's ``allowed-failures``).
"""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from handtrack.errors import InputError

#: How long the scheduler may take to answer.
ANSWER_S = 10.0


@contextmanager
def cluster_executor(address: str) -> Iterator[Executor]:
    """An executor whose work is done by the cluster at ``address`` (``tcp://host:8786``).

    Raises
    ------
    InputError
        Dask is not installed, nobody answers, or the cluster has no workers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "--scheduler needs dask.distributed, which is not installed: "
            "pip install 'handtrack[dask]'"
        ) from error
    try:
        client = Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there ({_first_line(error)})"
        ) from error
    with client:
        if not client.scheduler_info()["workers"]:
            raise InputError(f"--scheduler {address}: the cluster has no workers; start some")
        executor = client.get_executor(pure=False)
        try:
            yield executor
        finally:
            executor.shutdown(wait=False)


def _first_line(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
