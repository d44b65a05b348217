"""Work side by side: order, nesting, errors."""

import threading

import pytest

from handtrack.parallel import both, each


def test_results_come_in_order_whoever_is_first() -> None:
    gate = threading.Event()

    def wait_or_open(k: int) -> int:
        if k == 0:
            assert gate.wait(10)  # only another thread can open it
        else:
            gate.set()
        return k

    one, other = both(lambda: wait_or_open(0), lambda: wait_or_open(1))
    assert (one, other) == (0, 1)
    assert each(lambda k: k * k, range(20)) == [k * k for k in range(20)]


def test_work_within_work_does_not_wait_for_itself() -> None:
    def nested(k: int) -> list[int]:
        return each(lambda j: both(lambda: k, lambda: j)[1], range(3))

    assert each(nested, range(12)) == [[0, 1, 2]] * 12


def test_an_error_is_not_lost() -> None:
    with pytest.raises(ZeroDivisionError):
        each(lambda k: 1 // k, [1, 0])
