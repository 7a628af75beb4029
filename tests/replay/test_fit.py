"""Constants planted in recordings are recovered from distant starts, and the intervals have their stated coverage."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.api.given import the_runs
from straw.replay.errors import ReplayError
from straw.replay.identify.difference import Difference, _reread, with_values
from straw.replay.identify.fit import fit, most_different
from straw.rig.run import PressureLog, Run
from straw.tracking.trace import TipTrace

NAMES = ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", "r_ch_m")
SHORT = StrawParameters(cells=3)
TRUTH = np.array([150.0, 1.5e-3, 0.40e-3])
GAUGE_PA, SIGMAS = 30.0, (25e-6, 25e-6, 1.5e-3)


def recorded(steady_pa: float, deployed: tuple[int, ...], seed: int, truth: np.ndarray = TRUTH) -> Run:
    """Two seconds of a short straw with a noisy gauge and a noisy camera."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 2.0, 1 / 240)
    seen = simulate(with_values(SHORT, NAMES, truth), lambda t: steady_pa * -np.expm1(-30 * t), time_s, deployed)
    tip = [
        getattr(seen, name) + random.normal(0, s, len(time_s))
        for name, s in zip(("x_m", "z_m", "phi_rad"), SIGMAS, strict=True)
    ]
    at = np.arange(0.0, 2.0, 0.005)
    pressure_pa = steady_pa * -np.expm1(-30 * at) + random.normal(0, GAUGE_PA, len(at))
    return Run(
        path=None, sha256=str(seed), run_id=f"run-{seed}", specimen="", initial_deployed=deployed, cycle=0, cells=3,
        zero_time_ns=0, metadata={}, attachments={}, command=None,
        pressure=PressureLog(at, pressure_pa, np.full(len(at), GAUGE_PA)),
        tip=TipTrace(
            time_s, *tip, *(np.full(len(time_s), s) for s in SIGMAS), np.ones(len(time_s), bool), np.arange(len(time_s))
        ),
        predictions={}, events=(), lost=(),
    )  # fmt: skip


def test_damping_and_channel_are_recovered_from_distant_starts_within_their_intervals() -> None:
    runs = [recorded(-25e3, (1,), 1), recorded(32e3, (2, 3), 2)]
    starts = [np.array(s) for s in itertools.product((10.0, 600.0), (1e-3, 4e-3), (0.33e-3, 0.5e-3))]
    found = fit(runs, SHORT, NAMES, starts=starts)
    sigma = np.sqrt(np.diag(found.log_covariance))
    off = np.abs(np.log(found.value / TRUTH))
    assert np.all(off < 3.5 * sigma)  # three constants: exceeded once in 700 times
    assert np.all(sigma < [0.2, 0.2, 0.01])  # and the intervals are narrow enough to be of use
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.25)
    assert found.failures == 0
    np.testing.assert_allclose(found.straw.r_ch_m, found.value[2])


def test_the_gauges_noise_changes_a_slow_snap_as_much_as_when_the_run_is_simulated_again(shared: Path) -> None:
    """At these constants derivatives at the search's tolerance amplify the noise by hundreds."""
    (run,) = the_runs(shared / "recordings" / "open-a" / "fold-20kPa-2-5.mcap")
    at = np.log([19.42991222256893, 0.0020134428045833785, 0.0004000027537086787])
    difference = Difference(StrawParameters(), NAMES)
    changes = difference.gauge(run, at)
    again = [difference.at(dataclasses.replace(run, pressure=_reread(run.pressure, seed)), at) for seed in range(6)]
    simulated = np.stack(again, axis=-1) - difference.at(run, at)[..., np.newaxis]
    # of 6 and 12 draws the ratio of two standard deviations is within a factor of 3 (F of 6 and 12, 99.9 %: 8.4)
    assert 1 / 3 < np.sqrt(np.mean(changes**2) / np.mean(simulated**2)) < 3


def test_runs_that_differ_most_are_searched_first() -> None:
    one, other = recorded(-25e3, (1,), 1), recorded(32e3, (2, 3), 2)
    still = dataclasses.replace(
        one, tip=dataclasses.replace(one.tip, x_m=np.full(len(one.tip.x_m), 0.02)), run_id="still"
    )
    chosen = [run.run_id for run in most_different([still, one, other])]
    assert sorted(chosen) == ["run-1", "run-2"]


def test_runs_that_no_simulation_follows_are_refused() -> None:
    run = recorded(-25e3, (1,), 1)
    burst = dataclasses.replace(
        run, pressure=dataclasses.replace(run.pressure, pressure_pa=run.pressure.pressure_pa - 3e6)
    )
    with pytest.raises(ReplayError, match="none of the runs can be simulated"):
        fit([burst], SHORT, NAMES)
