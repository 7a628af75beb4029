"""A discovered curve, as the contract describes it and as a law file."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.model.law_file import laws_in
from straw.model.term import Frustum
from straw.replay.diagnose.formula import Formula
from straw.replay.diagnose.page.laws import laws_of
from straw.replay.diagnose.said import says
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.discovered import PLACES, discovered
from straw.replay.diagnose.systems.straw.missing import MissingLaw
from straw.replay.diagnose.systems.straw.states import STATES


def found(name, at, choose):
    state = next(s for s in STATES if s.name == name)
    chosen = tuple(atom for atom in atoms(state, at) if choose(atom.text))
    coefficients = np.linspace(2.0, 3.0, len(chosen))
    formula = Formula("F", chosen, coefficients, 0.1 * coefficients, ("N",) * len(chosen), 0.9)
    return MissingLaw(state, at, formula.of(at), np.ones(len(at)), np.ones(len(at)), formula)


def frustum(**state):
    return Frustum(**{"zeta": -3e-3, "phi": 0.1, "d_zeta": 0.02, "d_phi": 0.0, "zeta0": -4e-3} | state, C1=1.0, C2=1.0,
                   c_zeta=20.0, c_phi=2e-3, r_i=4e-3, r_o=6e-3, cycle=0.0)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "at", "choose"),
    [
        ("height", np.linspace(-4.4e-3, 3.8e-3, 8), lambda text: "0.4 mm" in text and "exp(-((" in text),
        ("angle", np.linspace(-0.3, 0.3, 8), lambda text: text in ("phi", "phi^3")),
        ("speed", np.geomspace(3e-3, 0.4, 8), lambda text: text in ("v", "sign v")),
    ],
)
def test_its_law_file_passes_the_contract_test_and_is_the_formula(tmp_path, name, at, choose):
    missing = found(name, at, choose)
    path = tmp_path / "law.py"
    path.write_text(discovered(missing, [1, 4])["law"])
    (law,) = laws_in(path)
    f = frustum()
    k = np.array([float(c.about.split()[1]) for c in law.constants])
    x = {"height": f.zeta, "angle": f.phi, "speed": f.d_zeta}[name]
    acts = law.force(f, k)[1 if name == "angle" else 0]
    expected = missing.formula.of(np.array([x]))[0] * (-1 if name == "speed" else 1)
    assert acts == pytest.approx(expected, rel=1e-4)  # constants are written with five digits


def test_every_curve_has_a_place_and_a_state_of_the_contract():
    assert set(PLACES) == {state.name for state in STATES}


def test_a_place_for_which_no_law_file_can_be_written_has_the_curve_alone():
    missing = found("flow", np.linspace(-1e-5, 1e-5, 8), lambda text: text == "Q")
    told = discovered(missing, [1, 4])
    assert told["place"] == "flow"
    assert told["law"] == ""
    assert told["cells"] == []
    assert len(told["curve"]) == 8


def test_the_verdict_names_a_curve_found_from_the_runs_where_it_improves_the_prediction_of_others():
    inquiry: Any = SimpleNamespace(whole=True, campaign=SimpleNamespace(observations=[0, 1, 2, 3]))
    told = says("unknown_physics", ["unknown"], {"unknown": 0.9}, inquiry, modelled="a force on the tip")
    assert "no hypothesis in the library explains in these 4 runs; it looks like a force on the tip" in told
    assert says("unknown_physics", ["unknown"], {"unknown": 0.9}, inquiry).endswith("none is named.")


def test_a_law_whose_formula_is_a_number_alone_is_called_constant():
    at = np.linspace(-12e-3, 2e-3, 8)
    wind = found("tip Z, along Z", at, lambda text: text == "")
    assert wind.says == "a constant force along Z on the tip: F = (2 ± 0.2) N"
    assert "depends" in found("tip Z, along Z", at, lambda text: text in ("", "Z")).says


def test_a_force_towards_a_point_is_told_with_the_points_place():
    law = found("tip distance", np.linspace(5e-3, 40e-3, 8), lambda text: text == "(10 mm/r)^2")
    law = replace(law, further=(("X", 55e-3, 2e-4), ("Z", -12e-3, 1e-4)))
    assert "distance from it (X = (55 ± 0.2) mm, Z = (-12 ± 0.1) mm): F = " in law.says
    told = discovered(law, [1, 4])
    assert (told["place"], told["states"]) == ("tip_force", ["tip_x", "tip_z"])
    findings: Any = SimpleNamespace(missing=SimpleNamespace(laws=[law]))
    (page,) = laws_of(findings, findings)
    assert {c.symbol: c.value for c in page.constants}.items() >= {"X_P": 55.0, "Z_P": -12.0}.items()
