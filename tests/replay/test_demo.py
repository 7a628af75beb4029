"""The demo conceals a cause, seals it and opens the seal; it reports of the diagnosis what the diagnosis found."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.cli import main
from straw.replay.commands import diagnose_system
from straw.replay.commands.demo import figures
from straw.replay.compare.comparison import CHANNELS
from straw.replay.demo.campaign import PLANS, FaultyGauge, protocol_of
from straw.replay.demo.conceal import CABLE, DRAWER, NOTHING, Concealed, Seal, draw, named, opened, story
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.errors import ReplayError

BASE = StrawParameters()


def said(verdict: str, *found: str, discovered: dict[str, Any] | None = None) -> Any:
    """Findings with the fields that the demo reads."""
    return SimpleNamespace(
        verdict=verdict,
        causes=list(found),
        parameters={},
        judgement=SimpleNamespace(probability={"complete": 1.0}),
        discovered=discovered,
    )


def test_a_seed_always_draws_the_same_effect_and_every_effect_has_its_seed() -> None:
    assert draw(5) == draw(5)
    assert {draw(seed).cause for seed in range(1, 200)} == set(DRAWER)


@pytest.mark.parametrize("cause", DRAWER)
def test_every_cause_that_may_be_concealed_changes_straw_or_instrument_and_is_in_the_contract(cause: str) -> None:
    concealed = Concealed(cause, DRAWER[cause])
    changed = bool(concealed.straw(BASE).terms) + (concealed.instrument != Instrument())
    assert changed == (cause != NOTHING)
    assert (cause in causes(9)) == (cause not in (NOTHING, CABLE))


def test_the_cable_pulls_the_tip_back_where_it_is_far_out_and_nowhere_else() -> None:
    def x_m(straw: StrawParameters, plan: int) -> np.ndarray:
        protocol = protocol_of(PLANS[plan])
        time_s = np.linspace(-protocol.zero_s, protocol.duration_s - protocol.zero_s, 200)
        return simulate(straw, protocol, time_s, protocol.initial_deployed).x_m

    cable = Concealed(CABLE, DRAWER[CABLE]).straw(BASE)
    length_m = float(np.sum(BASE.zeta0_m[:, 0] - BASE.zeta0_m[:, 1]))
    folded, deployed = x_m(BASE, 0), x_m(BASE, 1)
    assert folded.max() < 0.8 * length_m < deployed.max()
    np.testing.assert_allclose(x_m(cable, 0), folded, atol=1e-7)  # the simulation's tolerance
    assert np.max(deployed - x_m(cable, 1)) > 0.5e-3  # about fifty times the camera's noise


def test_the_cable_counts_as_found_where_it_acts_and_over_its_state() -> None:
    cable = Concealed(CABLE, DRAWER[CABLE])
    found = {"place": "tip_force", "states": ["tip_x"], "formula": "F(x) = 1 N"}
    assert named(cable, said("unknown_physics", "unknown", discovered=found))
    told = story(cable, Seal("{}"), Seal("{}").sha256, said("unknown_physics", discovered=found))
    assert "which the library does not hold; the diagnosis found it, as F(x) = 1 N" in told
    assert not named(cable, said("unknown_physics", discovered={**found, "place": "elsewhere"}))
    assert not named(cable, said("missing_physics", "cohesion"))


def test_a_seal_is_the_sha256_of_what_is_opened_and_two_of_the_same_effect_differ() -> None:
    first, second = Seal.on(draw(1)), Seal.on(draw(1))
    assert first.sha256 == hashlib.sha256(first.label.encode()).hexdigest() != second.sha256
    assert json.loads(first.label)["cause"] == draw(1).cause
    other = opened(draw(1), first, second.sha256, said("complete"))
    assert not other["sha256_agrees"]
    assert "NOT the one above" in story(draw(1), first, second.sha256, said("complete"))


def test_an_effect_counts_as_named_only_if_it_is_named_alone() -> None:
    late = Concealed("clock_offset", DRAWER["clock_offset"])
    assert named(late, said("measurement_fault", "clock_offset"))
    assert not named(late, said("ambiguous", "clock_offset", "line_lag"))
    assert not named(late, said("missing_physics", "line_lag"))
    assert named(Concealed(NOTHING, {}), said("complete"))
    assert not named(Concealed(NOTHING, {}), said("unknown_physics", "unknown"))
    told = story(late, Seal("{}"), Seal("{}").sha256, said("ambiguous", "clock_offset", "line_lag"))
    assert "not named: the diagnosis said ambiguous, clock_offset or line_lag" in told
    assert "nothing was concealed" in story(Concealed(NOTHING, {}), Seal("{}"), "", said("complete"))


def test_a_faulty_gauge_shows_its_offset_and_nothing_else_changes() -> None:
    true, shown = (FaultyGauge(Instrument(gauge_offset_pa=b), 0) for b in (0.0, 2000.0))
    assert shown.reading(0.0) - true.reading(0.0) == pytest.approx(2000.0)
    assert shown.pressure(0.0) == true.pressure(0.0) == 0.0


def test_the_demo_runs_are_short_and_of_both_directions() -> None:
    protocols = [protocol_of(plan) for plan in PLANS]
    assert sum(protocol.duration_s for protocol in protocols) < 11.0
    pressures = np.concatenate([protocol(np.linspace(0.0, protocol.duration_s, 50)) for protocol in protocols])
    assert pressures.min() == -25e3
    assert pressures.max() == 35e3


def test_the_figures_the_demo_prints_for_runs_that_were_not_fitted_are_those_of_the_hold_out() -> None:
    error = SimpleNamespace(rms=1e-6, largest=5e-6)
    filmed: Any = SimpleNamespace(recording=Path("fold.mcap"), errors=dict.fromkeys(CHANNELS, error))
    held: Any = SimpleNamespace(
        heldout=["deploy"],
        before=dict.fromkeys(CHANNELS, 40e-6),
        after=dict.fromkeys(CHANNELS, 20e-6),
        floor=dict.fromkeys(CHANNELS, 10e-6),
    )
    told = figures(filmed, held).splitlines()
    assert told[3] == "deploy, held out of the fit"
    assert [line.split()[-3:] for line in told[4:]] == [
        [n, n, f"{int(float(n)) / 1e3:.2f}"] for n in ("40.0", "20.0", "10.0")
    ]
    assert len(figures(filmed, None).splitlines()) == 3


def test_the_measured_demo_passes_every_option_of_its_command_to_the_diagnosis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The search itself, which takes 15 s, is left out."""

    def search(*_: object, **__: object) -> None:
        raise ReplayError("the search began")

    monkeypatch.setattr(diagnose_system, "discover", search)
    assert main(["demo", "--measured", "--out", str(tmp_path)]) == 2
    assert "the search began" in capsys.readouterr().err
