"""Batches give the same numbers in the same order wherever they run; one failed job does not affect the rest."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from straw.model.batch import Job, simulate_many
from straw.model.errors import ModelError
from straw.model.integrate import integrate
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction, simulate

TIME_S = np.arange(0, 0.3, 1 / 240)


def jobs() -> list[Job]:
    """Four different straws, under pressures that cannot be pickled, the third in a configuration it does not have."""
    return [
        Job(
            StrawParameters().replace(c_zeta_n_s_per_m=500.0 + 40 * i),
            lambda t, i=i: -1e3 * (20 + i) * (1 - np.exp(-50 * t)),
            TIME_S,
            (1, 4) if i != 2 else (1, 40),
        )
        for i in range(4)
    ]


@pytest.fixture(scope="module")
def alone() -> list[Prediction | ModelError]:
    """The results of the jobs in this process, one after the other."""
    return list(simulate_many(jobs()))


def assert_same(got: list[Prediction | ModelError], want: list[Prediction | ModelError]) -> None:
    assert [type(g) for g in got] == [type(w) for w in want] == [Prediction, Prediction, ModelError, Prediction]
    for g, w in zip(got, want, strict=True):
        if isinstance(w, Prediction):
            assert isinstance(g, Prediction)
            for name in vars(w):
                np.testing.assert_array_equal(getattr(g, name), getattr(w, name))
        else:
            assert str(g) == str(w)


def test_a_batch_gives_what_single_simulations_give(alone: list[Prediction | ModelError]) -> None:
    job = jobs()[1]
    single = simulate(job.straw, job.pressure, job.time_s, job.deployed)
    assert isinstance(alone[1], Prediction)
    np.testing.assert_array_equal(alone[1].x_m, single.x_m)


def test_a_job_that_cannot_be_simulated_yields_its_error_in_its_place(alone: list[Prediction | ModelError]) -> None:
    assert "40" in str(alone[2])
    hole = Job(StrawParameters(), lambda t: np.full_like(t, np.nan), TIME_S, ())
    assert [type(x) for x in simulate_many([hole, jobs()[0]])] == [ModelError, Prediction]


def test_threads_give_the_same_numbers(alone: list[Prediction | ModelError]) -> None:
    with ThreadPoolExecutor(2) as executor:
        assert_same(list(simulate_many(jobs(), executor)), alone)


def test_processes_give_the_same_numbers(alone: list[Prediction | ModelError]) -> None:
    """Spawned, as on Windows: all they have comes through a pickle and the machine code on disk."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert_same(list(simulate_many(jobs(), executor)), alone)


def test_a_dask_cluster_gives_the_same_numbers(alone: list[Prediction | ModelError], tmp_path: Path) -> None:
    """A real scheduler and two worker processes, reached through the client's own executor."""
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'straw[dask]'")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", local_directory=str(tmp_path)
        ) as cluster,
        distributed.Client(cluster) as client,
        client.get_executor() as executor,
    ):
        assert_same(list(simulate_many(jobs(), executor)), alone)


class ImmediateExecutor(Executor):
    """Runs each job when it is submitted, and counts the jobs."""

    def __init__(self) -> None:
        self.submitted = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted += 1
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.mark.usefixtures("alone")  # the process has simulated before
def test_an_endless_batch_is_consumed_only_a_bounded_number_of_jobs_ahead() -> None:
    taken = 0

    def endless() -> Iterator[Job]:
        nonlocal taken
        for _ in itertools.count():
            taken += 1
            yield jobs()[0]

    executor = ImmediateExecutor()
    results = simulate_many(endless(), executor, ahead=3)
    for _ in range(2):
        assert isinstance(next(results), Prediction)
    assert taken == executor.submitted == 2 + 3
    results.close()


class GivenFutures(Executor):
    """Returns the futures it was given, which stand for a cluster in any state."""

    def __init__(self, *futures: Future[Any]) -> None:
        self.waiting = list(futures)

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self.waiting.pop(0)


@pytest.mark.usefixtures("alone")
def test_jobs_not_started_are_cancelled_when_the_results_are_closed() -> None:
    done, queued, also_queued = futures = [Future[Any]() for _ in range(3)]
    done.set_result("first")
    results = simulate_many(jobs() * 2, GivenFutures(*futures), ahead=2)
    assert next(results) == "first"  # type: ignore[comparison-overlap]
    results.close()
    assert queued.cancelled()
    assert also_queued.cancelled()


@pytest.mark.usefixtures("alone")
def test_anything_but_a_model_error_is_raised() -> None:
    dead: Future[Any] = Future()
    dead.set_exception(RuntimeError("the worker died"))
    with pytest.raises(RuntimeError, match="the worker died"):
        next(simulate_many(jobs(), GivenFutures(dead), ahead=0))


def test_a_straw_that_was_pickled_is_the_same_to_the_compiled_model() -> None:
    """Arrays stay read-only: a writable one is another type, whose compilation takes half a minute."""
    straw = jobs()[0].straw.with_term("cohesion", force_n=1.0)
    back = pickle.loads(pickle.dumps(straw))
    assert back.to_toml() == straw.to_toml()
    ours, theirs = straw.constants(), back.constants()
    for a, b in zip(ours, theirs, strict=True):
        if isinstance(a, np.ndarray):
            assert a.flags.writeable == b.flags.writeable
            np.testing.assert_array_equal(a, b)


@pytest.mark.usefixtures("alone")
def test_read_only_arrays_do_not_compile_the_model_again() -> None:
    """Arrays from a cluster may be read-only, and so are those broadcast from a constant pressure."""
    known = list(integrate.signatures)
    times = TIME_S.copy()
    times.setflags(write=False)
    simulate(StrawParameters(), lambda t: np.broadcast_to(-1e3, t.shape), times, ())
    assert integrate.signatures == known
