"""Random effects of runs: whitening can be undone, follows the best fit, and finds runs that go the other way."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from straw.replay.diagnose import random_effects
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, evaluated
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.random_effects import linearise, linearise_at_best, one_run_misfits, to_conditional_mode
from straw.replay.diagnose.said import doubts
from straw.replay.diagnose.settings import NOISE_LEAVES

TIME_S = np.linspace(0, 1, 50)
RATE = Unknown("rate", 1.0, kind="linear", sd=10.0)
CAUSE = Unknown("cause", 1.0, kind="linear", sd=10.0)


class Decay:
    """Runs that decay at a rate, with a cause that adds a slope; each has a rate of its own within 5 %."""

    base = (RATE,)

    def size(self, recording, level):
        return len(TIME_S)

    def misfit(self, recording, unknowns, u, level, derivatives):
        at = dict(zip([k.target for k in unknowns], u, strict=True))
        shape = 100 * np.exp(-at["rate"] * TIME_S)
        columns = {"rate": -TIME_S * shape, "cause": 100 * TIME_S}
        vector = shape + 100 * at.get("cause", 0.0) * TIME_S - recording.seen[0]
        jacobian = np.column_stack([columns[k.target] for k in unknowns]) if derivatives else np.zeros((len(vector), 0))
        return SimpleNamespace(vector=vector, jacobian=jacobian, work=1.0)

    def repeats(self, campaign, fit):
        return 0.05 * fit.u[0] * evaluated(campaign, fit.unknowns, fit.u).slopes[:, :1]


@pytest.fixture
def campaign():
    runs = [
        SimpleNamespace(name=str(k), seen=[100 * np.exp(-rate * TIME_S) + 50 * TIME_S])
        for k, rate in enumerate((1.97, 2.0, 2.04))
    ]
    with ThreadPoolExecutor(1) as pool:
        yield Campaign(runs, Decay(), pool)


def inquiry(campaign):
    """The base at a rate far from the truth, and the cause near it."""
    far = evaluated(campaign, (RATE,), np.array([0.5]))
    linearise(campaign, far)
    found = Inquiry(campaign, evaluated(campaign, (RATE,), far.u))
    cause = Hypothesis(("cause",), (CAUSE,), ((0.0,),))
    found.keep(Contestant(cause, evaluated(campaign, (RATE, CAUSE), np.array([2.0, 0.5]))))
    return found


def test_whitening_is_undone_by_its_inverse(campaign):
    found = inquiry(campaign)
    plain = Campaign(campaign.observations, campaign.system, campaign.pool)
    expected = evaluated(plain, found.best.unknowns, found.best.u)
    undone = campaign.correlated(found.best.slopes, campaign.random_effects)
    np.testing.assert_allclose(undone, expected.slopes, rtol=1e-9, atol=1e-9)


def test_after_a_better_fit_all_fits_are_whitened_as_if_evaluated_there(campaign):
    found = inquiry(campaign)
    before = found.best.cost
    assert linearise_at_best(found)
    for fit in (found.null, found.best):
        anew = evaluated(campaign, fit.unknowns, fit.u)
        np.testing.assert_allclose(fit.residual, anew.residual, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(fit.slopes, anew.slopes, rtol=1e-7, atol=1e-7)
        assert fit.cost == pytest.approx(anew.cost)
    # at the rate of the base a repeat's difference has another shape, so that the right fit looked worse
    assert found.best.cost < before


def test_random_effects_stay_where_nothing_is_better_by_more_than_noise(campaign):
    found = inquiry(campaign)
    found.linearised_at = found.best.cost + NOISE_LEAVES
    effects = campaign.random_effects
    assert not linearise_at_best(found)
    assert campaign.random_effects is effects


def test_expansions_that_each_favour_another_fit_do_not_alternate(campaign, monkeypatch):
    """Whitened anew a fit may leave more, until it is fitted again: if that counted as better, it would go on."""
    found = inquiry(campaign)
    one = found.singles["cause"]

    def whitened(found, _before, _changed=None):
        found.singles["cause"] = replace(one, fit=replace(one.fit, cost=one.cost + 2 * NOISE_LEAVES))

    monkeypatch.setattr(random_effects, "_whiten_anew", whitened)
    assert linearise_at_best(found)
    assert found.best.cost > one.cost
    found.keep(one)  # fitted again
    assert not linearise_at_best(found)


class Forked(Decay):
    """The same, but beyond a rate of 2 a run ends elsewhere, as after another snap."""

    def misfit(self, recording, unknowns, u, level, derivatives):
        found = super().misfit(recording, unknowns, u, level, derivatives)
        if u[0] > 2.0:
            found.vector += 60 * TIME_S
        return found

    faults = ()

    def repeat_steps(self, unknowns):
        return {0: 0.05 * 1.95}

    def doubts(self, recordings):
        return []


def forked(pool, more=0.0):
    """Four runs, one of which goes the other way, with ``more`` that no rate explains in it; the cause near its fit."""
    runs = []
    for name, rate in {"a": 1.90, "b": 1.95, "c": 2.05, "d": 1.93}.items():
        seen = 100 * np.exp(-rate * TIME_S) + 50 * TIME_S
        if rate > 2.0:
            seen += 60 * TIME_S + more * np.sin(30 * TIME_S)
        runs.append(SimpleNamespace(name=name, seen=seen[None]))
    return inquiry(Campaign(runs, Forked(), pool))


def test_a_run_that_goes_the_other_way_gets_constants_of_its_own():
    with ThreadPoolExecutor(1) as pool:
        found = forked(pool)
        before, rate = found.best.cost, found.best.values["rate"]
        assert to_conditional_mode(found)
        ((run, own),) = found.campaign.own.items()
        assert run == "c"
        assert rate + own["rate"] == pytest.approx(2.05, abs=0.01)
        assert found.best.cost < before / 10
        for fit in (found.null, found.best):
            anew = evaluated(found.campaign, fit.unknowns, fit.u)
            np.testing.assert_allclose(fit.residual, anew.residual, rtol=1e-7, atol=1e-7)
            assert fit.cost == pytest.approx(anew.cost)
        assert not to_conditional_mode(found)
        # what is predicted is what all runs share
        ((_, _, shared, _),) = found.campaign.misfits(found.best.unknowns, [found.best.u])
        assert np.abs(shared.vector[-1]) > 50
        assert not found.campaign.only(["a", "b"]).own


def test_before_any_cause_is_fitted_the_run_that_misfits_beside_the_base_gets_constants_of_its_own():
    with ThreadPoolExecutor(1) as pool:
        found = forked(pool)
        best = found.best
        alone = Inquiry(found.campaign, best)  # all but one run are explained
        assert one_run_misfits(found.campaign, best)
        assert to_conditional_mode(alone)
        assert list(found.campaign.own) == ["c"]
        assert not one_run_misfits(found.campaign, alone.null)
        assert found.campaign.coarse().own == found.campaign.own


def test_two_runs_that_misfit_or_one_of_two_are_no_single_run_that_goes_the_other_way():
    with ThreadPoolExecutor(1) as pool:
        found = forked(pool)
        assert not one_run_misfits(found.campaign, found.null)  # far from all of them
        two = found.campaign.only(["a", "c"])
        assert not one_run_misfits(two, evaluated(two, found.best.unknowns, found.best.u))


def test_findings_say_which_run_has_constants_of_its_own():
    with ThreadPoolExecutor(1) as pool:
        found = forked(pool)
        found.whole = True
        assert doubts(found) == []
        to_conditional_mode(found)
        (said,) = doubts(found)
    assert said.startswith("run c is fitted with constants of its own")


def test_where_constants_of_its_own_do_not_explain_a_run_it_gets_none():
    with ThreadPoolExecutor(1) as pool:
        found = forked(pool, more=8.0)
        assert not to_conditional_mode(found)  # though with them it would misfit less
        assert not found.campaign.own
