"""One thread for the linear algebra: its matrices are so small that a second one makes it ten times slower."""

from __future__ import annotations

from threadpoolctl import threadpool_limits


def one_thread() -> threadpool_limits:
    """A context in which BLAS uses one thread in this process."""
    return threadpool_limits(limits=1, user_api="blas")
