"""Which runs are the most informative, and the base model's constants from any start."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.settings import NOISE_LEAVES
from straw.replay.diagnose.system import Level
from straw.replay.diagnose.systems.straw import base
from straw.replay.diagnose.systems.straw.base import base_fit, telling_runs
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import NONE, campaign


def _run(name: str, deployed: tuple[int, ...], snaps: int) -> SimpleNamespace:
    return SimpleNamespace(name=name, kind=deployed, events_s=np.arange(snaps), seen=np.array([[0.0, 1e-3 * snaps]]))


RUNS = [
    _run("fold", (1, 4), 4),
    _run("deploy-1", (), 4),
    _run("deploy-2", (), 3),
    _run("fold-other", (2, 5), 4),
    _run("deploy-with-6", (6,), 2),
    _run("deploy-with-7", (7,), 2),
    _run("staircase", (3,), 0),
]


def _told(monkeypatch: pytest.MonkeyPatch, left: dict[str, float]) -> list[str]:
    monkeypatch.setattr(base, "run_by_run", lambda campaign, fit: [left.get(o.name, 0.0) for o in RUNS])
    return telling_runs(cast(Campaign, SimpleNamespace(observations=RUNS)), None)  # type: ignore[arg-type]


def test_the_most_informative_run_of_each_start_and_one_without_a_snap_are_used(monkeypatch) -> None:
    assert sorted(_told(monkeypatch, {})) == ["deploy-1", "fold", "fold-other", "staircase"]


def test_a_start_with_unexplained_misfit_is_used_too_but_no_second_repeat(monkeypatch) -> None:
    left = {"deploy-2": 9 * NOISE_LEAVES, "deploy-with-6": 2 * NOISE_LEAVES, "deploy-with-7": 3 * NOISE_LEAVES}
    assert _told(monkeypatch, left)[4:] == ["deploy-with-7"]
    assert _told(monkeypatch, left | {"deploy-with-6": NOISE_LEAVES / 2, "deploy-with-7": NOISE_LEAVES / 3})[4:] == []


def test_damping_and_channel_are_found_from_a_straw_whose_constants_are_far_off() -> None:
    truth = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
    given = StrawParameters(r_ch_m=0.34e-3, c_zeta_n_s_per_m=150.0, c_phi_n_m_s_per_rad=0.4e-3)
    seen = [observe(run) for run in campaign((), 3, ("fold-25kPa", "deploy-35kPa-1"), NONE)]
    with ThreadPoolExecutor() as pool:
        fit, _ = base_fit(Campaign(seen, StrawSystem(given), pool))
    assert fit.cost < 1.1 * len(fit.residual)  # noise only
    assert fit.values["straw.r_ch_m"] == pytest.approx(truth.r_ch_m, rel=0.01)
    assert fit.values["straw.c_phi_n_m_s_per_rad"] == pytest.approx(2e-3, rel=0.1)


def test_constants_whose_powers_vanish_are_a_run_that_cannot_be_simulated() -> None:
    system = StrawSystem(StrawParameters())
    (seen,) = (observe(run) for run in campaign((), 3, ("fold-25kPa",), NONE))
    log_r = next(k for k, one in enumerate(system.base) if one.target == "straw.r_ch_m")
    at = np.zeros(len(system.base))
    at[log_r] = -2000.0  # of a search that steps too far: 1e-90 m, whose fourth power is 0
    for level in Level:
        assert system.misfit(seen, system.base, at, level=level, derivatives=True) is None
