"""Snaps of a prediction are matched with those of a recording, where one has some that the other lacks."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.settings import MISSING_EVENT_SIGMAS
from straw.replay.diagnose.system import Level
from straw.replay.diagnose.systems.straw.library import hypothesis
from straw.replay.diagnose.systems.straw.matching import matched, without_odd
from straw.replay.diagnose.systems.straw.misfit import coarse_misfit, misfit
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import NONE, campaign

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)


@pytest.fixture(scope="module")
def fold():
    """A run of the apparatus with the base constants and nothing concealed, in which two cells snap."""
    return observe(campaign((), 3, ("fold-25kPa",), NONE)[0])


@pytest.mark.parametrize(
    ("seen", "told", "pairs"),
    [
        ([0.8, 0.9, 1.4, 1.5], [0.85, 0.95, 1.45, 1.55], [(0, 0), (1, 1), (2, 2), (3, 3)]),
        ([1.48, 1.52], [0.79, 0.80, 1.43, 1.47], [(0, 2), (1, 3)]),  # the first did not reach the level
        ([0.79, 0.80, 1.43, 1.47], [1.48, 1.52], [(2, 0), (3, 1)]),
        ([0.8, 0.9, 1.4, 1.5], [1.3, 1.4, 1.9, 2.0], [(0, 0), (1, 1), (2, 2), (3, 3)]),
        ([], [0.8, 0.9], []),
        ([0.8, 0.9], [], []),
    ],
)
def test_a_snap_that_only_one_of_the_two_has_does_not_shift_the_others(seen, told, pairs):
    mine, others = matched(np.array(seen), np.array(told))
    assert list(zip(mine.tolist(), others.tolist(), strict=True)) == pairs


def test_beginnings_are_never_matched_with_ends():
    rng = np.random.default_rng(1)
    for _ in range(200):
        seen, told = (np.sort(rng.uniform(0, 3, 2 * rng.integers(0, 4))) for _ in range(2))
        mine, others = matched(seen, told)
        assert np.all((mine - others) % 2 == 0)
        assert np.all(np.diff(mine) > 0)
        assert np.all(np.diff(others) > 0)


def test_a_ring_taken_for_an_end_is_an_outlier_and_a_late_camera_is_not():
    np.testing.assert_array_equal(without_odd(np.array([0.0, 0.001, -0.002, 0.34])), [True, True, True, False])
    np.testing.assert_array_equal(without_odd(np.array([0.0, 0.34])), [True, False])
    assert without_odd(np.array([0.06, 0.061, 0.059])).all()
    assert without_odd(np.empty(0)).all()


@pytest.mark.parametrize("unseen", [[0, 1], [2, 3], [1, 2]])
def test_a_snap_that_just_missed_its_threshold_costs_the_true_straw_no_more_than_noise_may(fold, unseen):
    assert len(fold.snaps_s) == 4
    # as if the first or the last had not reached the threshold, or the ringing of the first had not crossed it again
    less = replace(fold, snaps_s=np.delete(fold.snaps_s, unseen))
    for how in (
        lambda run: misfit(run, BASE, (), np.empty(0)).vector,
        lambda run: coarse_misfit(run, BASE, (), np.empty(0))[0],
    ):
        # time is no longer warped there, for snaps that are less than a millisecond, one sigma, late
        assert robust_cost(how(less)) < robust_cost(how(fold)) + len(unseen) * (MISSING_EVENT_SIGMAS**2 + 5)


def test_a_straw_with_other_snaps_fits_nothing_that_follows(fold):
    # a cell that is a fifth weaker folds earlier, and before the other: it does not fit the recording
    weak = BASE.with_term("frustum_spread", E_relative=np.array([-0.2, *[0.0] * 8]))
    right, wrong = (robust_cost(misfit(fold, straw, (), np.empty(0)).vector) for straw in (BASE, weak))
    assert wrong > 3 * right


@pytest.mark.parametrize(("name", "value"), [("clock_offset", 60.0), ("clock_offset", -60.0), ("clock_drift", -1.5)])
def test_a_clock_offset_longer_than_the_run_is_an_error(fold, name, value):
    (unknown,) = hypothesis([name], BASE.cells).unknowns
    system = StrawSystem(BASE)
    for level, derivatives in itertools.product(Level, (False, True)):
        at = np.array([unknown.at(value / unknown.scale)])
        assert system.misfit(fold, (unknown,), at, level=level, derivatives=derivatives) is None
