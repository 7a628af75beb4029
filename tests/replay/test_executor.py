"""Everything the diagnosis sends to an executor can be pickled, as a Dask cluster or a pool of processes requires."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.oscillator.system import OscillatorSystem
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.workers import threads
from tests.apparatus.campaign import NONE, campaign
from tests.replay.test_system import SOME, stiffening


class PicklingExecutor(Executor):
    """Runs each job at once, through pickles of the job and of its result: all that another process would receive."""

    def submit(self, work: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        work, args, kwargs = pickle.loads(pickle.dumps((work, args, kwargs)))
        done.set_result(pickle.loads(pickle.dumps(work(*args, **kwargs))))
        return done


def test_a_run_simulated_in_another_process_has_the_same_residual() -> None:
    base = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
    observed, unknowns = [observe(run) for run in campaign((), 3, ("staircase",), NONE)], base_unknowns(base)
    with ThreadPoolExecutor(1) as threads, PicklingExecutor() as elsewhere:
        here, there = (
            Campaign(observed, StrawSystem(base), pool).residuals(unknowns, [np.zeros(len(unknowns))])[0]
            for pool in (threads, elsewhere)
        )
    # the second starts from the rest state that the first found, to the accuracy of that search
    np.testing.assert_allclose(there, here, atol=1e-4)


def test_a_dask_cluster_of_processes_finds_what_threads_find() -> None:
    distributed = pytest.importorskip("distributed", reason="dask's workers are not installed")
    records, found = stiffening(5e9), []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        for dask in (None, cluster.scheduler_address):
            with threads(2, dask) as pool:
                searched = inquire(records, OscillatorSystem(), library=SOME[:1], executor=pool)
                findings = conclude(searched, brief=True)
            found.append(findings.as_json())
    assert found[0]["causes"] == ["cubic_stiffness"]
    assert found[0] == found[1]


def test_the_linear_algebra_of_a_search_has_one_thread() -> None:
    def blas() -> set[int]:
        return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}

    during: list[set[int]] = []
    with threadpool_limits(limits=2, user_api="blas"), threads(1) as pool:
        before = blas()
        if before != {2}:
            pytest.skip("threadpoolctl cannot set the threads of this machine's BLAS")
        inquire(
            stiffening(5e9),
            OscillatorSystem(),
            library=("cubic_stiffness",),
            executor=pool,
            told=lambda *_: during.append(blas()),
        )
        assert blas() == before
    assert during
    assert all(one == {1} for one in during)
