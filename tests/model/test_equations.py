"""The equations of motion are the paper's, in both forms."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from straw.model.kinematics import tip_pose
from straw.model.parameters import StrawParameters
from straw.model.straw import acceleration, kinetic_energy_at, mass_at, pressure_at, residual, volume_at
from tests.model.paper import PaperStraw


def cases(shared: Path, form: str) -> list[dict[str, Any]]:
    file = json.loads((shared / "reference" / "accelerations.json").read_text())
    return next(states for key, states in file.items() if key.startswith(form))


def straw_of(case: dict[str, Any], form: str) -> StrawParameters:
    return StrawParameters(
        form=form, r_ch_m=case["r_ch_m"], c_zeta_n_s_per_m=case["c_zeta"], c_phi_n_m_s_per_rad=case["c_phi"]
    )


def test_accelerations_of_the_truncated_form_match_an_independent_derivation_to_1e_8(shared: Path) -> None:
    for case in cases(shared, "truncated"):
        c = straw_of(case, "truncated").constants()
        got = acceleration(c, np.array(case["q"]), np.array(case["v"]), case["p_external_pa"])
        np.testing.assert_allclose(got, case["acceleration"], rtol=1e-8)


def test_accelerations_of_the_full_form_satisfy_the_equations_to_rounding_although_inertia_is_singular(
    shared: Path,
) -> None:
    """M has rank 30 of 36, so a forward comparison of M^-1 F is a comparison of rounding errors; see acceleration."""
    for case in cases(shared, "full"):
        c = straw_of(case, "full").constants()
        q, v, a = (np.array(case[name]) for name in ("q", "v", "acceleration"))
        M, still = mass_at(c, q), np.zeros_like(q)
        scale = np.where(np.arange(36) < 18, 1.0, 1 / c.r_i)
        eigenvalues = np.linalg.eigvalsh(M / np.outer(scale, scale))
        assert np.sum(np.abs(eigenvalues) > 1e-17 * eigenvalues[-1]) <= 30
        force = residual(c, q, v, still, case["p_external_pa"])
        left = np.abs(M @ a - force) / (np.abs(M) @ np.abs(a) + np.abs(force))
        assert left.max() < 1e-14


@pytest.mark.parametrize("form", ["truncated", "full"])
def test_pose_pressure_energy_and_volume_match_the_reference_states_in_both_forms(shared: Path, form: str) -> None:
    for case in cases(shared, form):
        c = straw_of(case, form).constants()
        q, v = np.array(case["q"]), np.array(case["v"])
        np.testing.assert_allclose(tip_pose(c, q), case["tip_x_z_phi"], rtol=1e-12)
        assert pressure_at(c, v, case["p_external_pa"]) == pytest.approx(case["p_pa"], rel=1e-12)
        assert kinetic_energy_at(c, q, v) == pytest.approx(case["kinetic_energy_j"], rel=1e-12)
        assert volume_at(c, q) == pytest.approx(case["volume_m3"], rel=1e-12)


def test_the_residual_of_the_full_form_is_lagranges_equations_of_the_printed_formulas_to_1e_8() -> None:
    """Well posed where the accelerations are not: any (q, v, a), against the paper's text at 50 digits."""
    rng = np.random.default_rng(7)
    N = 3
    straw = StrawParameters(
        cells=N, form="full", c_zeta_n_s_per_m=31.0, c_phi_n_m_s_per_rad=2e-3, phi_0_rad=1.1,
        F_X_n=0.3, F_Z_n=-0.2, M_Y_n_m=0.01,
    )  # fmt: skip
    paper = PaperStraw(
        N,
        r_i=straw.r_i_m, r_o=straw.r_o_m, E=0.92e9, h=0.508e-3, zeta0_odd=3.78e-3, zeta0_even=-2.28e-3,
        rho=1000.0, g=9.795, phi_0=1.1, m_tip=straw.m_tip_kg, I_tip=straw.I_tip_kg_m2,
        c_zeta=31.0, c_phi=2e-3, r_ch=straw.r_ch_m, F_X=0.3, F_Z=-0.2, M_Y=0.01,
    )  # fmt: skip
    for _ in range(3):
        q = np.concatenate([rng.normal(3.78e-3, 1e-4, N), rng.uniform(-2.3e-3, 2e-3, N), rng.normal(0, 0.1, 2 * N)])
        v = np.concatenate([rng.normal(0, 0.02, 2 * N), rng.normal(0, 5.0, 2 * N)])
        a = np.concatenate([rng.normal(0, 50.0, 2 * N), rng.normal(0, 5e3, 2 * N)])
        want = np.array([float(x) for x in paper.residual(list(q), list(v), list(a), 12e3)])
        got = residual(straw.constants(), q, v, a, 12e3)
        np.testing.assert_allclose(got, want, rtol=1e-8, atol=1e-10 * np.abs(want).max())


def test_the_truncated_form_is_the_full_form_with_odd_frusta_held_at_rest() -> None:
    rng = np.random.default_rng(3)
    N = 9
    q2, v2, a2 = (np.concatenate([rng.normal(0, s, N), rng.normal(0, 50 * s, N)]) for s in (1e-3, 1e-2, 10.0))
    held = np.zeros(N)
    q4 = np.concatenate([np.full(N, 3.78e-3), q2[:N], held, q2[N:]])
    v4, a4 = (np.concatenate([held, x[:N], held, x[N:]]) for x in (v2, a2))
    small, full = StrawParameters().constants(), StrawParameters(form="full").constants()
    even = np.r_[N : 2 * N, 3 * N : 4 * N]
    np.testing.assert_allclose(residual(small, q2, v2, a2, 1e4), residual(full, q4, v4, a4, 1e4)[even], rtol=1e-10)
    np.testing.assert_allclose(mass_at(small, q2), mass_at(full, q4)[np.ix_(even, even)], rtol=1e-12)


def test_constants_of_the_papers_specimen_are_the_verified_numbers() -> None:
    c = StrawParameters().constants()
    assert c.C1[0, 1] == pytest.approx(3.36335e8, rel=1e-5)
    assert c.C2[0, 1] == pytest.approx(695.26, rel=1e-5)
    assert pytest.approx(1.36992e-4, rel=1e-5) == c.C3
    assert pytest.approx(5.24067e-4, rel=1e-5) == c.S
    assert pytest.approx(c.C3 + math.pi * c.r_i**2, rel=1e-12) == c.S


def test_constants_of_single_frusta_enter_the_equations() -> None:
    """A cell with a third of the stiffness has a third of the restoring force."""
    E = np.full((9, 2), 0.92e9)
    E[3, 1] /= 3
    q = np.concatenate([np.full(9, 1e-3), np.zeros(9)])
    still = np.zeros(18)
    soft, hard = (StrawParameters(E_pa=e, g_m_per_s2=0.0).constants() for e in (E, 0.92e9))
    ratio = residual(soft, q, still, still, 0.0)[:9] / residual(hard, q, still, still, 0.0)[:9]
    np.testing.assert_allclose(ratio, [1, 1, 1, 1 / 3, 1, 1, 1, 1, 1], rtol=1e-12)
