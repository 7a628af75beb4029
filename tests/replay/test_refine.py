"""From a coarse fit to all samples: draws find the right cycle of an oscillation if the coarse fit is good enough."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from straw.replay.diagnose.fit import Fit, evaluated, fitted
from straw.replay.diagnose.refine import drawn, refined, without_a_run
from straw.replay.diagnose.settings import FAILED_SIGMAS, FIRST_ROUNDS, ROUNDS
from tests.replay.test_fit_campaign import FIRST, SECOND, Toy

SAMPLES = 480
TIME_S = np.arange(SAMPLES) / 240


class Ringing(Toy):
    """A tip that rings at an unknown frequency with an amplitude of 30 sigmas, in one run of one channel; below
    ``least_hz`` it cannot be simulated."""

    def __init__(self, true_hz, least_hz=0.0):
        super().__init__(self.ringing)
        self.true_hz, self.least_hz = true_hz, least_hz
        self.system = SimpleNamespace(base=(FIRST,))
        self.observations = [SimpleNamespace(seen=np.zeros((1, SAMPLES)))]

    def ringing(self, v):
        if v[0].real < self.least_hz:
            return np.full(SAMPLES, FAILED_SIGMAS, dtype=complex)
        return 30 * (np.sin(2 * np.pi * v[0] * TIME_S) - np.sin(2 * np.pi * self.true_hz * TIME_S))

    def misfits(self, unknowns, points):
        return [[None if u[0] < self.least_hz else u] for u in points]

    def slices(self):
        return [slice(0, SAMPLES)]


def coarse(at_hz, misfit):
    """A coarse fit at a frequency, known to 0.2 Hz, that leaves ``misfit`` sigmas in each of its 25 residuals."""
    slopes = np.full((25, 1), 1 / 0.2 / 5)
    return Fit((FIRST,), np.array([at_hz]), np.full(25, misfit), slopes, 25 * misfit**2)


class RingingAndCreeping(Toy):
    """Two runs with one unknown frequency: a tip that rings at it, and one that creeps at a speed that goes with it."""

    def __init__(self, true_hz, names=("rings", "creeps")):
        super().__init__(lambda v: np.concatenate([self.run(name, v[0]) for name in names]))
        self.true_hz = true_hz
        self.observations = [SimpleNamespace(name=name, seen=np.zeros((1, SAMPLES))) for name in names]

    def run(self, name, hz):
        if name == "creeps":
            return 2 * (hz - self.true_hz) * TIME_S
        return 30 * (np.sin(2 * np.pi * hz * TIME_S) - np.sin(2 * np.pi * self.true_hz * TIME_S))

    def only(self, names):
        return RingingAndCreeping(self.true_hz, tuple(names))

    def slices(self):
        return [slice(k * SAMPLES, (k + 1) * SAMPLES) for k in range(len(self.observations))]


def test_draws_about_a_coarse_fit_find_the_right_cycle_of_an_oscillation():
    fit = refined(Ringing(true_hz=6.0), coarse(4.6, 0.5), ROUNDS)  # three cycles off after two seconds
    assert fit.u[0] == pytest.approx(6.0, abs=1e-3)


def test_no_draws_are_made_about_a_coarse_fit_whose_misfit_is_too_large():
    campaign = Ringing(true_hz=6.0)
    refined(campaign, coarse(4.6, 2.0), ROUNDS)
    assert campaign.asked <= 2 * FIRST_ROUNDS + 1  # a residual and a Jacobian in each round


def test_draws_leave_a_region_where_a_run_cannot_be_simulated():
    fit = refined(Ringing(true_hz=6.0, least_hz=5.0), coarse(4.6, 2.0), ROUNDS)
    assert fit.u[0] == pytest.approx(6.0, abs=1e-3)


def test_draws_follow_a_penalty_on_roughness_as_the_fit_does():
    """Two unknowns of which the data determine only the sum; the penalty ties the second to twice the first."""
    fit = Fit((FIRST, SECOND), np.zeros(2), np.zeros(25), np.ones((25, 2)), 0.0)
    points = np.array(drawn(fit, 1, np.array([[2e3, -1e3]])))
    np.testing.assert_allclose(points[:, 1], 2 * points[:, 0], rtol=1e-2, atol=1e-4)
    assert np.ptp(points[:, 0]) > 0


def test_a_fit_held_by_one_run_in_a_wrong_cycle_is_freed_by_leaving_that_run_out():
    both = RingingAndCreeping(true_hz=6.0)
    held = fitted(both, (FIRST,), np.array([4.6]), rounds=ROUNDS)
    assert without_a_run(both, held).u[0] == pytest.approx(6.0, abs=1e-3)


def test_a_fit_that_leaves_noise_only_and_one_of_a_single_run_are_not_restarted():
    right, one = RingingAndCreeping(true_hz=6.0), RingingAndCreeping(true_hz=6.0, names=("rings",))
    for campaign, at_hz in ((right, 6.0), (one, 4.6)):
        fit = evaluated(campaign, (FIRST,), np.array([at_hz]))
        assert without_a_run(campaign, fit) is fit
