"""A word to whoever waits for the first frame: after an installation, code is compiled once.

The inner loops are compiled when they are first used and kept from then on. That takes about half
a minute, in which the progress bar stands at its beginning.
"""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from tqdm import tqdm

#: How long the first frame takes before it is worth a word.
PATIENCE_S = 4.0
WORD = "The first run after an installation compiles its inner loops once: about half a minute."


@contextmanager
def word_if_slow(bar: "tqdm[object]") -> Iterator[None]:
    """Say it above ``bar`` if no frame is done in a while, and the bar is shown at all."""

    def speak() -> None:
        if bar.n == 0:
            bar.write(WORD, file=sys.stderr)

    timer = threading.Timer(PATIENCE_S, speak)
    timer.daemon = True
    if not bar.disable:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
