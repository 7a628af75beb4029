"""A second cause is accepted where it gains more than it does by chance in simulated campaigns with the first alone."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from straw.replay.diagnose.bootstrap import SIMULATED, accept, chance_gains
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.fit import Contestant, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.systems.oscillator.system import FINE, RATE_HZ, SIGMA_M, OscillatorSystem, Record, played

SAMPLES = 600
CUBIC, FRICTION = 5e9, 0.5


def records(friction_n: float, seed: int = 5) -> list[Record]:
    """Two levels of noise on an oscillator of 10 N s/m and 100 kN/m with a cubic spring, and friction."""
    rng, out = np.random.default_rng(seed), []
    for level in (20.0, 50.0):
        smooth = np.convolve(rng.normal(size=SAMPLES * FINE + 1), np.hanning(24), mode="same")
        force = level * smooth / np.std(smooth)
        k = np.array([10.0, 1e5, CUBIC, 0, 0, friction_n, 0, 1.0, 0, 0, 0])
        y = played(force, k, 2 / (RATE_HZ * FINE))[:: FINE // 2][:SAMPLES]
        noise = SIGMA_M * rng.normal(size=SAMPLES)
        out.append(Record(f"{level:.0f}N", force, np.arange(SAMPLES) / RATE_HZ, y + noise))
    return out


@pytest.fixture(scope="module")
def alone() -> Iterator[Inquiry]:
    """Runs with a cubic spring and nothing else, explained by it."""
    with ThreadPoolExecutor() as pool:
        yield inquire(records(0.0), OscillatorSystem(), library=("cubic_stiffness",), executor=pool)


def test_by_chance_a_cause_with_one_constant_gains_a_chi_square_of_one_degree_of_freedom(alone):
    fit, other = alone.best, alone.campaign.hypothesis(["quadratic_damping"])
    noise = np.random.default_rng(1).normal(size=len(fit.residual))
    gains = chance_gains(alone.campaign, fit, [other], noise)
    assert gains.shape == (SIMULATED,)
    for beyond in (0.5, 0.1):  # the share of simulated campaigns beyond a quantile is binomial
        share = float(np.mean(gains > chi2.isf(beyond, 1)))
        assert share == pytest.approx(beyond, abs=4 * np.sqrt(beyond * (1 - beyond) / SIMULATED))


def test_a_second_cause_that_is_present_is_accepted_and_the_findings_name_the_null_it_was_tested_against():
    with ThreadPoolExecutor() as pool:
        found = inquire(records(FRICTION), OscillatorSystem(), executor=pool)
        findings = conclude(found, brief=True)
    assert set(findings.causes) == {"cubic_stiffness", "dry_friction"}
    (chance,) = found.chance.values()
    assert chance.gain > chance.most
    assert any(f"{SIMULATED} simulated campaigns with {chance.first.replace('_', ' ')}" in n for n in findings.notes)


def test_a_second_cause_that_gains_no_more_than_by_chance_is_left_out_whatever_its_probability(alone):
    class SureOfTheBestFit(Inquiry):
        def judgement(self):
            """Gives the best fit a probability of one."""
            return SimpleNamespace(probability={self.contestants[0].name: 1.0})

    campaign, first = alone.campaign, alone.contestants[0]
    second = campaign.hypothesis(["quadratic_stiffness"])
    u = np.concatenate([first.fit.u, second.starts[0]])
    both = Contestant(
        second.beside(first.hypothesis), fitted(campaign, (*first.fit.unknowns, *second.unknowns), u, rounds=40)
    )
    assert both.cost < first.cost  # an additional constant always lowers the cost
    found = SureOfTheBestFit(campaign, alone.null)
    found.keep(first)
    found.keep(both)
    accept(found, campaign.system.causes)
    assert not found.pairs
    assert not found.chance
