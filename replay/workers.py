"""Where many small jobs run: here, on this machine's cores, or on a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread

from straw.replay.errors import ReplayError

#: How long a scheduler, and its first worker, may take to answer, s.
ANSWERS_S = 10.0


@contextmanager
def threads(jobs: int, dask: str | None = None) -> Iterator[Executor]:
    """An executor for the compiled model, which releases the GIL: threads here, or a Dask cluster."""
    if dask:
        with workers(1, dask) as executor:
            assert executor is not None
            yield executor
        return
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        yield pool


@contextmanager
def workers(jobs: int, dask: str | None = None) -> Iterator[Executor | None]:
    """An executor of ``jobs`` processes, of a Dask scheduler's address, or None for one job at a time here."""
    if dask:
        try:
            from distributed import Client
        except ImportError:
            raise ReplayError("--dask needs the package distributed: pip install 'straw[dask]'") from None
        try:
            client = Client(dask, timeout=ANSWERS_S)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as error:
            raise ReplayError(
                f"--dask {dask}: no scheduler answers there: {error}; start one with dask scheduler"
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=ANSWERS_S)
            except TimeoutError:
                raise ReplayError(
                    f"--dask {dask}: the scheduler has no workers; start one with dask worker {dask}"
                ) from None
            yield client.get_executor()  # type: ignore[no-untyped-call]
        return
    if jobs <= 1:
        yield None
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _end_with_parent() -> None:
    """Have this worker end when the command that started it does, also where that was killed in the middle of a job."""
    parent = parent_process()
    if parent is not None:
        Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
