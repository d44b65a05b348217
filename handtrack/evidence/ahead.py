"""Doing the next thing while this one is used: an iterator run ahead in a thread.

At most ``n`` items wait, so memory stays bounded; an exception of the iterator comes out where
its item would have. Leaving the loop early stops the thread and closes the iterator.

>>> list(run_ahead(lambda: iter(range(4)), n=2))
[0, 1, 2, 3]
"""

import queue
import threading
from collections.abc import Callable, Generator, Iterator
from typing import Any, TypeVar

Item = TypeVar("Item")

_END = object()


def run_ahead(make: Callable[[], Iterator[Item]], n: int) -> Generator[Item, None, None]:
    """The items of ``make()``, made in a thread up to ``n`` ahead of their use."""
    waiting: queue.Queue[Any] = queue.Queue(maxsize=n)
    stop = threading.Event()

    def offer(item: Any) -> bool:
        while not stop.is_set():
            try:
                waiting.put(item, timeout=0.1)
                return True
            except queue.Full:
                continue
        return False

    def work() -> None:
        try:
            for item in make():
                if not offer((item, None)):
                    return
        except BaseException as error:
            offer((None, error))
        else:
            offer((_END, None))

    thread = threading.Thread(target=work, name="decode", daemon=True)
    thread.start()
    try:
        while True:
            item, error = waiting.get()
            if error is not None:
                raise error
            if item is _END:
                return
            yield item
    finally:
        stop.set()
        thread.join()
