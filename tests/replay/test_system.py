"""The engine diagnoses systems other than a straw through the interface of a system alone."""

from __future__ import annotations

import ast
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import straw.replay.diagnose
from straw.replay.diagnose import coarse_search, diagnosis, explain
from straw.replay.diagnose import findings as findings_module
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.fit import Contestant, evaluated, fitted
from straw.replay.diagnose.heldout import Held
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.pairs import nested
from straw.replay.diagnose.rivals import absent
from straw.replay.diagnose.settings import NOISE_LEAVES
from straw.replay.diagnose.systems.oscillator.system import (
    FINE,
    LIBRARY,
    RATE_HZ,
    SIGMA_M,
    OscillatorSystem,
    Record,
    played,
)

SAMPLES = 600
SOME = ("cubic_stiffness", "dry_friction")


def stiffening(cubic_n_per_m3: float) -> list[Record]:
    """Two levels of band-limited noise on an oscillator of 10 N s/m and 100 kN/m with a cubic spring."""
    rng, out = np.random.default_rng(5), []
    for level in (20.0, 50.0):
        steps = SAMPLES * FINE + 1
        smooth = np.convolve(rng.normal(size=steps), np.hanning(24), mode="same")
        force = level * smooth / np.std(smooth)
        k = np.array([10.0, 1e5, cubic_n_per_m3, 0, 0, 0, 0, 1.0, 0, 0, 0])
        y = played(force, k, 2 / (RATE_HZ * FINE))[:: FINE // 2][:SAMPLES]
        time_s = np.arange(SAMPLES) / RATE_HZ
        out.append(Record(f"{level:.0f}N", force, time_s, y + SIGMA_M * rng.normal(size=SAMPLES)))
    return out


@pytest.mark.parametrize(
    ("cubic", "verdict", "causes"), [(5e9, "missing_physics", ["cubic_stiffness"]), (0.0, "complete", [])]
)
def test_a_spring_that_stiffens_is_named_and_a_linear_one_is_complete(cubic, verdict, causes):
    with ThreadPoolExecutor() as pool:
        findings = conclude(inquire(stiffening(cubic), OscillatorSystem(), executor=pool), brief=True)
    assert (findings.verdict, findings.causes) == (verdict, causes)
    if cubic:
        found = findings.parameters["cubic_stiffness"]["k3"]
        assert abs(found["value"] - cubic) < 3 * found["sigma"]
        assert found["unit"] == "N/m^3"


def test_the_order_of_the_recordings_does_not_matter():
    records = stiffening(5e9)
    with ThreadPoolExecutor(1) as pool:
        one, other = (
            inquire(given, OscillatorSystem(), library=SOME, executor=pool) for given in (records, records[::-1])
        )
    assert one.judgement() == other.judgement()


def test_as_long_as_much_is_left_every_cause_is_fitted_from_its_own_starts(monkeypatch):
    monkeypatch.setattr(explain, "FAR", np.inf)
    monkeypatch.setattr(explain, "screen", lambda *_args: [])
    with ThreadPoolExecutor() as pool:
        found = inquire(stiffening(3e8), OscillatorSystem(), library=SOME, executor=pool)
    best = found.ranked_singles[0]
    assert best.name == "cubic_stiffness"
    assert unexplained(found.campaign, best.fit) <= NOISE_LEAVES


def test_a_cause_that_predicts_held_out_runs_worse_is_not_named_and_the_base_model_is_kept(monkeypatch):
    one, two = {"y_m": 1e-5}, {"y_m": 2e-5}
    floor, moves, steps = {"y_m": SIGMA_M}, {"y_m": 1e-3}, (("cubic_stiffness", two),)
    held = Held(("20N",), ("50N",), 9.0, 1.0, one, two, floor, moves, steps)
    monkeypatch.setattr(findings_module, "hold_out", lambda *_args: held)
    with ThreadPoolExecutor() as pool:
        found = inquire(stiffening(5e9), OscillatorSystem(), library=("cubic_stiffness",), executor=pool)
        findings = conclude(found)
    assert findings.judgement.probability["cubic_stiffness"] > 0.8
    assert (findings.verdict, findings.causes, findings.parameters) == ("ambiguous", ["cubic_stiffness"], {})
    assert findings.says.startswith("Nothing is named: cubic stiffness explains all runs together best (probability 0.")
    assert "predicts them worse than the base (y 0.01 -> 0.02 mm)" in findings.says
    written = findings.as_json()
    assert written["fit"]["heldout"]["rms_after"] == one
    assert written["explained"] == []


def only_in_a_pair(campaign: Campaign) -> tuple[Inquiry, float]:
    """A search that found a stiffening spring only in a pair with friction of no effect, and that pair's cost."""
    base = campaign.system.base
    null = fitted(campaign, base, np.zeros(len(base)), rounds=20)
    alone, other = (campaign.hypothesis([name]) for name in ("cubic_stiffness", "dry_friction"))
    found = Inquiry(campaign, null)
    found.keep(absent(null, alone))  # as a search that stayed at zero strength leaves it
    unknowns = (*base, *alone.unknowns, *other.unknowns)
    planted = np.array([np.log(10.0 / 20.0), 0.0, np.arcsinh(5e9 / 3e9), 0.0])
    both = fitted(campaign, unknowns, planted, rounds=40)
    assert both.cost < null.cost / 100  # else the single one would be best as it is
    found.keep(Contestant(other.beside(alone), both))
    return found, both.cost


def test_a_cause_with_a_stuck_search_is_fitted_from_a_pair_whose_other_cause_has_no_effect():
    with ThreadPoolExecutor() as pool:
        found, both = only_in_a_pair(Campaign(stiffening(5e9), OscillatorSystem(), pool))
        nested(found)
    assert found.singles["cubic_stiffness"].cost < both + 1.0  # friction that is absent gains less than this


def test_causes_of_a_pair_as_good_as_the_best_but_for_noise_are_tried_alone_too():
    with ThreadPoolExecutor() as pool:
        campaign = Campaign(stiffening(5e9), OscillatorSystem(), pool)
        found, both = only_in_a_pair(campaign)
        one, other = [campaign.hypothesis([name]) for name in LIBRARY if name != "cubic_stiffness"][:2]
        unknowns = (*campaign.system.base, *one.unknowns, *other.unknowns)
        better = replace(evaluated(campaign, unknowns, np.zeros(len(unknowns))), cost=both - 10.0)
        found.keep(Contestant(other.beside(one), better))
        nested(found)
    assert found.singles["cubic_stiffness"].cost < both + 1.0


def test_a_spent_budget_still_tries_each_cause_of_the_best_pair_alone(monkeypatch):
    class OscillatorWithSpentBudget(OscillatorSystem):
        most_work = 1.0

    def only_one(campaign, *_):
        stop, campaign.stop = campaign.stop, lambda: False
        found, _ = only_in_a_pair(campaign)
        campaign.stop = stop
        return found

    monkeypatch.setattr(diagnosis, "explain", only_one)
    with ThreadPoolExecutor() as pool:
        found = diagnosis.inquire(stiffening(5e9), OscillatorWithSpentBudget(), executor=pool)
    assert found.spent
    assert found.singles["cubic_stiffness"].cost < found.pairs["cubic_stiffness+dry_friction"].cost + 1.0


def poor(campaign, *_):
    """A search that ended at the base's constants, far from noise."""
    base = campaign.system.base
    found = Inquiry(campaign, fitted(campaign, base, np.zeros(len(base)), rounds=20))
    found.keep(absent(found.null, campaign.hypothesis(["cubic_stiffness"])))
    return found


def test_a_search_that_ends_far_from_noise_is_restarted_with_one_run_left_out(monkeypatch):
    monkeypatch.setattr(diagnosis, "explain", poor)
    monkeypatch.setattr(diagnosis, "finished", lambda _campaign, one, _rounds: one)
    with ThreadPoolExecutor() as pool:
        found = diagnosis.inquire(stiffening(5e9), OscillatorSystem(), executor=pool)
    assert not found.goes_on


def test_a_fit_that_is_continued_does_not_simulate_its_start_again():
    with ThreadPoolExecutor() as pool:
        campaign = Campaign(stiffening(5e9), OscillatorSystem(), pool)
        fit = fitted(campaign, campaign.system.base, np.zeros(len(campaign.system.base)), rounds=20)
        played = campaign.tally["played"]
        assert fitted(campaign, fit.unknowns, fit.u, rounds=1).cost == fit.cost
        assert campaign.tally["played"] == played
        fitted(campaign, fit.unknowns, fit.u + 1e-3, rounds=1)
        assert campaign.tally["played"] == played + len(campaign.observations)


def test_restarts_end_with_the_budget(monkeypatch):
    class Spent(OscillatorSystem):
        most_work = 1.0

    monkeypatch.setattr(diagnosis, "explain", poor)
    restarted = []
    monkeypatch.setattr(diagnosis, "finished", lambda campaign, one, _rounds: restarted.append(campaign.stop()) or one)
    with ThreadPoolExecutor() as pool:
        found = diagnosis.inquire(stiffening(5e9), Spent(), executor=pool)
    assert restarted == [True]
    assert found.spent
    assert found.goes_on


def test_the_base_is_also_fitted_from_the_result_of_fewer_runs(monkeypatch):
    records, system, starts = stiffening(0.0), OscillatorSystem(), []
    with ThreadPoolExecutor() as pool:
        before = diagnosis.inquire(records[:1], system, library=(), executor=pool)

        def far_off(_self, campaign, _starts):
            far = evaluated(campaign, campaign.system.base, np.array([3.0, 3.0]))
            return far, far

        def watched(campaign, unknowns, u, **how):
            starts.append(np.array(u))
            return fitted(campaign, unknowns, u, **how)

        monkeypatch.setattr(OscillatorSystem, "fit_base", far_off)
        monkeypatch.setattr(explain, "fitted", watched)
        both = diagnosis.inquire(records, system, library=(), executor=pool, before=before)
    samples = sum(len(record.y_m) for record in records)
    assert any(np.array_equal(u, before.null.u) for u in starts)
    assert both.null.cost < samples + 5 * np.sqrt(2 * samples)  # chi-square of the samples' noise


def test_a_cause_named_before_is_a_start_of_the_next_search(monkeypatch):
    records = stiffening(5e9)
    with ThreadPoolExecutor() as pool:
        before = diagnosis.inquire(records, OscillatorSystem(), library=SOME, executor=pool)
        monkeypatch.setattr(coarse_search.CoarseSearch, "until", lambda *_args: None)  # no other starts
        monkeypatch.setattr(explain, "screen", lambda *_args: [])
        monkeypatch.setattr(diagnosis, "without_a_run", lambda _campaign, fit: fit)
        monkeypatch.setattr(diagnosis, "finished", lambda _campaign, one, _rounds: one)
        after = diagnosis.inquire(records, OscillatorSystem(), library=SOME, executor=pool, before=before)
    for one in (before, after):
        assert next(iter(one.judgement().probability)) == "cubic_stiffness"
        assert not one.goes_on


def test_derivatives_of_the_oscillator_are_those_of_wider_differences():
    system, (record, _) = OscillatorSystem(), stiffening(5e9)
    unknowns = (*system.base, *LIBRARY["cubic_stiffness"][0], *LIBRARY["dry_friction"][0])
    u = np.array([0.1, 0.1, 0.5, 0.0])
    one = system.misfit(record, unknowns, u, derivatives=True)
    assert one is not None
    for k in range(4):
        h = 1e-3 * np.eye(4)[k]
        low = u if unknowns[k].low == u[k] else u - h
        ends = [system.misfit(record, unknowns, np.array(at)) for at in (u + h, low)]
        slope = (ends[0].vector - ends[1].vector) / (u + h - low)[k]  # type: ignore[union-attr]
        # a one-sided difference errs by half its step times the second derivative, which is of the first one's order
        assert np.linalg.norm(one.jacobian[:, k] - slope) < 5e-3 * np.linalg.norm(slope)


def test_a_system_can_be_pickled_for_workers():
    assert pickle.loads(pickle.dumps(OscillatorSystem(("dry_friction",)))).causes == ("dry_friction",)


def test_the_engine_imports_nothing_of_a_system():
    """Files of the engine itself; the proposal learned for straws (`propose`) is passed to it as an object."""
    for path in Path(str(straw.replay.diagnose.__file__)).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith(("straw.replay.diagnose.systems", "model", "rig")), path
