"""One batch at a time in a folder: two would do the same clips twice."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from handtrack.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows, where two batches in one folder cost time and nothing else
    fcntl = None  # type: ignore[assignment]


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Hold ``folder`` (made if need be) for this batch; the system frees it if we die.

    Raises
    ------
    OutputError
        Another batch holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w", encoding="utf-8") as file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise OutputError(
                    f"{folder.parent}: another batch is at work in this folder; wait for it or "
                    "choose another with --out"
                ) from error
        yield
