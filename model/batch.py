"""Many simulations, in order, on any `concurrent.futures.Executor`: threads, processes or a cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.integrate import integrate
from straw.model.parameters import StrawParameters
from straw.model.simulate import TOLERANCE_M, Prediction, run, sampled

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Job:
    """What one call of `straw.model.simulate.simulate` takes."""

    straw: StrawParameters
    pressure: Callable[[Floats], Floats]
    time_s: Floats
    deployed: Collection[int]
    tolerance_m: float = TOLERANCE_M


def simulate_many(
    jobs: Iterable[Job], executor: Executor | None = None, *, ahead: int = 64
) -> Iterator[Prediction | ModelError]:
    """Simulate jobs and give their predictions in the jobs' order; without an executor here, one after the other.

    A `ThreadPoolExecutor` uses all cores, as the compiled core releases the GIL; a `ProcessPoolExecutor` and a Dask
    client's ``client.get_executor()`` plug in unchanged. Pressures are sampled here, so they may be lambdas.

    A job that raises ModelError (no such rest state, constants out of range) yields that error in its place: in a
    search over constants that is a result. Anything else, such as a worker that died, is raised.

    ``jobs`` may be endless: no more than ``ahead`` are taken before their turn, so that neither waiting jobs nor
    finished predictions (half a megabyte each for 6 s) pile up; at least twice the number of workers keeps all busy.
    Those not yet started are cancelled where the iterator is closed or fails.
    """
    waiting: deque[Future[Prediction | ModelError]] = deque()
    try:
        for job in jobs:
            waiting.append(_started(job, executor))
            if len(waiting) > (ahead if executor else 0):
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


def _started(job: Job, executor: Executor | None) -> Future[Prediction | ModelError]:
    here: Future[Prediction | ModelError] = Future()
    try:
        ready = job.straw, sampled(job.pressure, job.time_s), job.time_s, job.deployed, job.tolerance_m
    except ModelError as error:
        here.set_result(error)
        return here
    # The first job of a process runs here, so that workers find compiled code, forked or on disk.
    if executor and getattr(integrate, "signatures", None):  # a compiled function's, one for each that is compiled
        return executor.submit(_outcome, *ready)
    here.set_result(_outcome(*ready))
    return here


def _outcome(
    straw: StrawParameters, table: Table, time_s: Floats, deployed: Collection[int], tolerance_m: float
) -> Prediction | ModelError:
    try:
        return run(straw, table, time_s, deployed, tolerance_m)
    except ModelError as error:
        return error
