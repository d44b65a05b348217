"""Independent pieces of one frame's work, side by side.

The compiled kernels let go of the interpreter's lock, so threads really run beside each other.
What comes back is in the order of what went in, and whoever needs random numbers is handed a
generator of its own: results do not depend on how many threads there are.

>>> each(lambda a, b: a * b, [1, 2, 3], [4, 5, 6])
[4, 10, 18]
"""

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

T = TypeVar("T")
U = TypeVar("U")
#: More threads than this gain nothing: between kernels the lock is held.
MOST_THREADS = 4
_here = threading.local()


def each(function: Callable[..., T], *arguments: Iterable[Any]) -> list[T]:
    """``[function(*a) for a in zip(*arguments)]``, on several cores.

    Inside such a call everything is done in order: a thread that waits for another of the same
    few would wait for ever.
    """
    run = map if _is_helper() else _pool(os.getpid()).map
    return list(run(function, *arguments))


def both(one: Callable[[], T], other: Callable[[], U]) -> tuple[T, U]:
    """``one(), other()``, side by side."""
    if _is_helper():
        return one(), other()
    beside = _pool(os.getpid()).submit(other)
    return one(), beside.result()


def _is_helper() -> bool:
    return getattr(_here, "helps", False)


def _mark() -> None:
    _here.helps = True


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """The threads of a process; a forked one gets its own."""
    threads = min(os.cpu_count() or 1, MOST_THREADS)
    return ThreadPoolExecutor(threads, f"handtrack-{process}", initializer=_mark)
