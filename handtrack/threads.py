"""Linear algebra on one thread, so that the bytes of a result do not depend on the machine's cores.

A product of matrices that is shared out among threads sums in another order, and rounds otherwise.
Ours are too small to gain from threads.

>>> from threadpoolctl import threadpool_info
>>> with linear_algebra_on_one_thread():
...     {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}
{1}
"""

from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401  the limit is for libraries that are loaded; SciPy has its own
from threadpoolctl import threadpool_limits


@contextmanager
def linear_algebra_on_one_thread() -> Iterator[None]:
    """Within the block, BLAS and LAPACK use one thread in all of this process."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
