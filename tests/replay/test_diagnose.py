"""Diagnosis of campaigns of an apparatus that shares no code with the model: fits, searches, and what is refused."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import run as simulate
from straw.model.simulate import sampled
from straw.model.straw_file import straw_from_toml
from straw.replay.cli import main
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.fit import Contestant, Fit, evaluated, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.rivals import from_each_other
from straw.replay.diagnose.said import says
from straw.replay.diagnose.screen import screen
from straw.replay.diagnose.settings import COARSE_TOLERANCE_M, TOLERANCE_M
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.diagnose.systems.straw.menu import Choice, menu, written
from straw.replay.diagnose.systems.straw.misfit import misfit
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.simulated import most_steps_per_s
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.paper.runs import DEPLOYMENT
from straw.rig.protocol_toml import load_protocol
from tests.apparatus.campaign import NONE, campaign
from tests.apparatus.campaign import write as write_run
from tests.apparatus.effects import Cause

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
FEW = ("fold-25kPa", "deploy-35kPa-1", "deploy-30kPa-6", "staircase")


@pytest.fixture(scope="module")
def plain():
    """A specimen of the apparatus with the base constants and nothing concealed."""
    return [observe(run) for run in campaign((), 3, FEW, NONE)]


def test_an_ambiguous_verdict_spells_out_complete_and_unknown(plain):
    with ThreadPoolExecutor() as pool:
        found = Inquiry(
            Campaign(plain, StrawSystem(BASE), pool), Fit((), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 0.0)
        )
    found.whole = True
    said = says("ambiguous", ["cohesion"], {"unknown": 0.45, "complete": 0.3, "cohesion": 0.25}, found)
    assert "cannot tell cohesion (0.25) from nothing missing (0.30) from something outside the library (0.45)" in said
    said = says("ambiguous", [], {"unknown": 0.49, "complete": 0.47, "cohesion": 0.04}, found)
    assert "cannot tell nothing missing (0.47) from something outside the library (0.49)" in said
    assert "experiment" not in said  # no experiment is proposed
    said = says("ambiguous", ["cohesion"], {"cohesion": 0.78, "unknown": 0.04, "complete": 0.04}, found)
    assert "cohesion (0.78) is most probable, but not enough" in said


def test_the_apparatus_true_constants_leave_only_noise(plain):
    for observed in plain:
        one = misfit(observed, BASE, (), np.empty(0))
        assert np.mean(one.shape**2) < 1.2
        assert np.all(np.abs(one.late_s) < 4e-3)


def test_the_base_model_recovers_its_constants_from_wrong_ones(plain):
    unknowns = base_unknowns(BASE)
    with ThreadPoolExecutor() as pool:
        fit = fitted(
            Campaign(plain, StrawSystem(BASE), pool),
            unknowns,
            np.array([0.1, 0.2, -0.2, 0.5, 0.3, 0.3, -0.3]),
            rounds=20,
        )
    found = fit.values
    assert found["straw.r_ch_m"] == pytest.approx(0.40e-3, rel=0.01)
    assert found["straw.c_phi_n_m_s_per_rad"] == pytest.approx(2e-3, rel=0.05)


@pytest.mark.parametrize("choice", menu(9), ids=lambda choice: choice.name)
def test_every_experiment_on_the_menu_runs_on_the_rig_within_its_limits(choice: Choice, tmp_path):
    path = tmp_path / "next.toml"
    path.write_text(written(choice))
    protocol = load_protocol(path)
    assert protocol.initial_deployed == choice.deployed
    assert protocol.duration_s == pytest.approx(1.0 + sum(seconds for _, seconds in choice.holds))


def test_a_concealed_late_clock_is_named_measured_and_improves_runs_it_did_not_fit():
    """By an independent apparatus; the library is cut to a few rivals, the campaign to three runs, to keep it short:
    `python -m tests.benchmarks.concealed` has all of both."""
    runs = campaign((Cause("clock_offset", 0.05, "", 1),), 4, (*FEW[:2], "staircase"), NONE)
    rivals = ("clock_offset", "line_lag", "gauge_gain")
    with ThreadPoolExecutor() as pool:
        found = inquire([observe(run) for run in runs], StrawSystem(BASE), library=rivals, executor=pool)
        findings = conclude(found, brief=True)
    assert findings.verdict == "measurement_fault"
    assert findings.causes == ["clock_offset"]
    offset = findings.parameters["clock_offset"]["clock_offset_s"]
    assert abs(offset["value"]) == pytest.approx(0.05, abs=2e-3)
    assert findings.held is not None
    assert not set(findings.held.heldout) & set(findings.held.train)
    assert findings.held.after["x_m"] < findings.held.before["x_m"] / 2
    assert sum(findings.judgement.probability.values()) == pytest.approx(1.0)
    straw_from_toml(findings.as_json()["straw"])


def test_an_inquiry_that_is_stopped_settles_nothing_and_holds_nothing_out(plain):
    with ThreadPoolExecutor() as pool:
        findings = conclude(inquire(plain[:3], StrawSystem(BASE), executor=pool, stop=lambda: True))
    assert findings.verdict == "ambiguous"
    assert findings.causes == []
    assert findings.held is None
    assert "Stopped before every cause was tried" in findings.says


def test_the_first_order_gain_is_zero_for_an_absent_cause_and_largest_for_the_one_present(plain):
    """Linearised at zero strength of both causes, with the base model's constants free."""
    late = [observe(run) for run in campaign((Cause("gauge_gain", 0.03),), 3, FEW[:2], NONE)]
    with ThreadPoolExecutor(2) as pool:
        for seen, there in ((plain[:2], False), (late, True)):
            here = Campaign(seen, StrawSystem(BASE), pool)
            null = fitted(here, base_unknowns(BASE), np.zeros(len(base_unknowns(BASE))), rounds=10)
            promised = screen(here, null, [here.hypothesis([name]) for name in ("gauge_gain", "dry_friction")])
            assert (promised[0].gain > 100) == there
            if there:
                assert promised[0].hypothesis.name == "gauge_gain"


def test_a_rival_whose_search_ended_far_away_is_fitted_again_from_the_winners_constants():
    concealed = Cause("gauge_offset", 1500.0)
    seen = [observe(run) for run in campaign((concealed,), 5, FEW[:2], NONE)]
    with ThreadPoolExecutor(2) as pool:
        whole = Campaign(seen, StrawSystem(BASE), pool, lambda: False)
        base = base_unknowns(BASE)

        def stands(name, at, own):
            what = whole.hypothesis([name])
            return Contestant(what, evaluated(whole, (*base, *what.unknowns), np.array([at] * len(base) + own)))

        # one starts at the true constants of the base; the other is the true cause, stuck in a poor minimum
        roll, gauge = stands("camera_roll", 0.0, [0.0]), stands("gauge_offset", 0.05, [-0.5])
        assert gauge.cost > roll.cost
        null = evaluated(whole, base, np.full(len(base), 0.05))
        found = Inquiry(whole, null, {"camera_roll": roll, "gauge_offset": gauge})
        from_each_other(found)
        again = found.singles["gauge_offset"].fit
        assert found.null.cost < null.cost
    assert again.cost < len(again.residual) < roll.cost  # only noise is left
    assert again.values["instrument.gauge_offset_pa"] == pytest.approx(1500.0, rel=0.2)


def test_failed_simulations_are_counted_also_in_a_part_of_the_campaign(plain):
    with ThreadPoolExecutor() as pool:
        whole = Campaign(plain, StrawSystem(BASE), pool)
        part = whole.only([plain[0].name]).coarse()
        part.misfits(base_unknowns(BASE), [np.array([0, 0, 0, 0, 60.0, 0, 0])])  # walls too thick for two states
    assert (whole.tally["played"], whole.tally["failed"]) == (1, 1)


@pytest.mark.parametrize("tolerance_m", [TOLERANCE_M, COARSE_TOLERANCE_M])
def test_the_papers_faster_run_is_simulated_within_the_allowed_steps(tolerance_m):
    time_s = np.linspace(0, 3.0, 721)
    table = sampled(DEPLOYMENT.pressure_pa, time_s)
    most = most_steps_per_s(tolerance_m) / 1.3  # of the steps tried; beyond that it raises
    played = simulate(DEPLOYMENT.straw, table, time_s, DEPLOYMENT.deployed, tolerance_m, most_steps_per_s=most)
    assert played.steps < most * 3.0


def test_an_undamped_straw_counts_as_a_failed_simulation(plain):
    undamped = BASE.replace(c_zeta_n_s_per_m=1e-2, c_phi_n_m_s_per_rad=1e-5)
    with ThreadPoolExecutor() as pool:
        few = Campaign(plain[:1], StrawSystem(undamped), pool)
        few.misfits((), [np.zeros(0)])
    assert (few.tally["played"], few.tally["failed"]) == (1, 1)


def test_runs_of_two_specimens_or_one_run_twice_are_refused_in_one_line(tmp_path, capsys):
    one, other = campaign((), 3, FEW[3:], NONE, name="a"), campaign((), 3, FEW[:1], NONE, name="b")
    a, b = write_run(one[0], tmp_path / "a.mcap"), write_run(other[0], tmp_path / "b.mcap")
    assert main(["diagnose", str(a), str(b)]) == 2
    assert "runs of 2 specimens (a, b); diagnose one at a time" in capsys.readouterr().err
    assert main(["diagnose", str(a), "--without", "magic", "--without", "cohesion"]) == 2
    assert "no such cause" in capsys.readouterr().err


def test_a_run_that_starts_where_no_straw_can_rest_is_refused_in_one_line(tmp_path, capsys):
    from straw.rig.run import PressureLog

    (run,) = campaign((), 3, FEW[3:], NONE)
    high = PressureLog(run.pressure.time_s, run.pressure.pressure_pa + 60e3, run.pressure.sigma_pa)
    path = write_run(replace(run, pressure=high), tmp_path / "high.mcap")
    assert main(["diagnose", str(path)]) == 2
    assert "run staircase: the straw cannot be simulated from where this run starts" in capsys.readouterr().err


def test_the_diagnosis_of_one_run_without_a_snap_says_what_it_could_not_decide(tmp_path, capsys):
    run = write_run(campaign((), 3, FEW[3:], NONE)[0], tmp_path / "one.mcap")
    most = [name for name in causes(9) if name not in ("clock_offset", "gauge_gain")]
    status = main(["diagnose", str(run), "--json", str(tmp_path / "f.json"), "--without", *most])
    told = json.loads((tmp_path / "f.json").read_text())
    assert status in (0, 1)
    assert told["verdict"] in ("complete", "ambiguous")
    assert any("no run shows a snap" in note for note in told["notes"])
    assert any("nothing could be held out" in note for note in told["notes"])
    assert capsys.readouterr().out
