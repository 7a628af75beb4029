"""Fits that begin in a valley that is not the deepest and arrive all the same."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import Contestant
from straw.replay.diagnose.hypothesis import base_unknowns
from straw.replay.diagnose.knocks import cell_by_cell, knocked
from straw.replay.diagnose.library import causes, hypothesis
from straw.replay.diagnose.observation import observe
from straw.replay.diagnose.search import descend
from straw.replay.diagnose.start import dampings
from tests.apparatus.campaign import NONE, campaign
from tests.apparatus.effects import Cause

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
DRAW, SIZE = 1, 0.18


def test_cells_are_told_from_constants_that_all_cells_share() -> None:
    unknowns = (*base_unknowns(BASE), *hypothesis(["frustum_spread"], 9).unknowns)
    assert cell_by_cell(unknowns) == list(range(len(unknowns) - 9, len(unknowns)))
    assert not cell_by_cell(hypothesis(["intrinsic_curvature"], 9).unknowns)


@pytest.mark.parametrize("cause", causes(9))
def test_every_cause_can_be_knocked_by_dampings(cause) -> None:
    unknowns = (*base_unknowns(BASE), *hypothesis([cause], 9).unknowns)
    points = np.array(dampings(unknowns, np.zeros(len(unknowns))))
    assert len(np.unique(points, axis=0)) == len(points) > 1
    assert list(np.flatnonzero(np.ptp(points, axis=0))) == [
        k for k, one in enumerate(unknowns) if one.target in ("straw.c_zeta_n_s_per_m", "straw.c_phi_n_m_s_per_rad")
    ]


def test_cells_that_snap_in_another_order_are_found() -> None:
    runs = campaign(
        (Cause("frustum_spread", SIZE, "all cells differ", DRAW),), 3, ("fold-25kPa", "deploy-35kPa-1"), NONE
    )
    true = 0.5 * SIZE * np.clip(np.random.default_rng(DRAW).normal(size=9), -2.0, 2.0)
    observations = [observe(run) for run in runs]
    for one in observations:
        one.rest_of(BASE)
    spread = hypothesis(["frustum_spread"], 9)
    unknowns = (*base_unknowns(BASE), *spread.unknowns)
    with ThreadPoolExecutor() as pool:
        outlines = Campaign(observations, BASE, pool).roughly()
        u = np.concatenate([np.zeros(len(unknowns) - 9), np.arcsinh(true / spread.unknowns[0].scale)])
        right = descend(outlines, unknowns, u, rounds=0).cost
        second, fourth = cell_by_cell(unknowns)[1], cell_by_cell(unknowns)[3]
        u[[second, fourth]] = u[[fourth, second]]
        exchanged = Contestant(spread, descend(outlines, unknowns, u, rounds=0))
        free = knocked(outlines, exchanged, 40, 3e-3)
    assert exchanged.cost > 10 * right
    assert free.cost < 1.1 * right  # as good as the truth, two runs need not tell it from others


def test_damping_that_starts_far_too_small_is_found() -> None:
    observations = [observe(run) for run in campaign((), 3, ("fold-25kPa", "deploy-35kPa-1"), NONE)]
    for one in observations:
        one.rest_of(BASE)
    unknowns = base_unknowns(BASE)
    u = np.zeros(len(unknowns))
    with ThreadPoolExecutor() as pool:
        right = descend(Campaign(observations, BASE, pool).roughly(), unknowns, u, rounds=0).cost
        outlines = Campaign(observations, BASE, pool).roughly()  # that knows no steps from where all is well
        u[1:3] = -4.0  # damping by e^-4
        ringing = Contestant(hypothesis([], 9), descend(outlines, unknowns, u, rounds=0))
        free = knocked(outlines, ringing, 40, 3e-3)
    assert ringing.cost > 10 * right
    assert free.cost < 1.1 * right
