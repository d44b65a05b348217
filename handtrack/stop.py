"""Being asked to stop: Ctrl-C and SIGTERM set a mark that a loop looks at between two frames.

A second Ctrl-C ends at once. Outside the main thread, where Python takes no signals, the mark is
never set.

>>> with stop_signals() as asked:
...     bool(asked)
False
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class StopAsked:
    """True once somebody asked for a stop."""

    def __init__(self) -> None:
        self._asked = False

    def __bool__(self) -> bool:
        return self._asked

    def ask(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        """Ask for a stop; the second time there is no waiting for it."""
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True


@contextmanager
def stop_signals() -> Iterator[StopAsked]:
    """SIGINT and SIGTERM only ask, inside the block."""
    asked = StopAsked()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    before = {
        number: signal.signal(number, asked.ask) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
