"""A short version of the concealed cases: a law of another form.

The apparatus shares no code with the model; `python -m tests.benchmarks.concealed` is the long version, with sealed
labels and all runs of specimens of any damping. Those drawn here are damped strongly and simulated in half the time.
`tests/benchmarks/proofs` has whole searches.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import fitted
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.random_effects import linearise
from straw.replay.diagnose.settings import NOISE_LEAVES
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.library import hypothesis
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import campaign
from tests.apparatus.effects import Cause

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
RUNS = ("fold-25kPa", "deploy-35kPa-1", "staircase", "deploy-35kPa-3")
#: Damping 4.6 and 3.0 times the base's (axial, bending).
SPECIMEN = 39


def test_a_law_of_relaxation_fits_two_relaxation_times_and_leaves_bending_elastic() -> None:
    wall = Cause("viscoelasticity", 1000.0, "two branches")
    seen = [observe(run) for run in campaign((wall,), SPECIMEN, RUNS[:2])]
    for one in seen:
        one.rest_of(BASE)
    base, law = base_unknowns(BASE), hypothesis(["viscoelasticity"], BASE.cells)
    starts = [np.concatenate([np.zeros(len(base)), start]) for start in law.starts[2:4]]  # either side of two valleys
    with ThreadPoolExecutor(2) as pool:
        whole = Campaign(seen, StrawSystem(BASE), pool)
        ends = [fitted(whole.coarse(), (*base, *law.unknowns), start, rounds=20) for start in starts]
        coarse = min(ends, key=lambda fit: fit.cost)
        linearise(whole, fitted(whole, coarse.unknowns, coarse.u, rounds=20))
        found = fitted(whole, coarse.unknowns, coarse.u, rounds=20)
        without = fitted(whole, base, np.zeros(len(base)), rounds=20)
        left, missing = unexplained(whole, found), unexplained(whole, without)
    assert left < NOISE_LEAVES < missing
    assert found.values["term.viscoelasticity&viscoelasticity_slow.bending"] < 0.2
