"""An iterator run ahead in a thread."""

import threading
import time

import pytest

from handtrack.evidence.ahead import run_ahead


def test_order_is_kept():
    assert list(run_ahead(lambda: iter(range(100)), n=3)) == list(range(100))


def test_error_comes_out_where_its_item_would_have():
    def make():
        yield 1
        yield 2
        raise ZeroDivisionError

    items = run_ahead(make, n=5)
    assert [next(items), next(items)] == [1, 2]
    with pytest.raises(ZeroDivisionError):
        next(items)


def test_never_more_than_n_ahead():
    made = []

    def make():
        for k in range(50):
            made.append(k)
            yield k

    items = run_ahead(make, n=3)
    next(items)
    time.sleep(0.1)
    assert len(made) <= 5  # one used, three waiting, one in hand
    items.close()


def test_leaving_early_closes_the_iterator_and_ends_the_thread():
    closed = threading.Event()

    def make():
        try:
            while True:
                yield 0
        finally:
            closed.set()

    before = threading.active_count()
    items = run_ahead(make, n=2)
    next(items)
    items.close()
    assert threading.active_count() == before
    assert closed.wait(1)
