"""Simulations agree with accurate solutions by another solver, and errors say what to do."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction, Stepper, simulate

FOLDING = StrawParameters()
DEPLOYMENT = FOLDING.replace(c_zeta_n_s_per_m=0.1, c_phi_n_m_s_per_rad=3e-3, r_ch_m=0.315e-3)
RUNS = {
    "fold": (FOLDING, -25e3, [1, 4]),
    "deploy": (DEPLOYMENT, 35e3, [2, 3, 5, 6, 7, 8, 9]),
}


def crossing_s(time_s: np.ndarray, zeta: np.ndarray) -> float:
    i = int(np.flatnonzero(np.sign(zeta[1:]) != np.sign(zeta[:-1]))[0])
    return float(time_s[i] - zeta[i] * (time_s[i + 1] - time_s[i]) / (zeta[i + 1] - zeta[i]))


@pytest.mark.parametrize("name", ["fold", "deploy"])
def test_the_papers_two_validation_runs_match_the_reference_solutions(shared: Path, name: str) -> None:
    """Required: X, Z within 10 um RMS, Phi within 0.3 mrad RMS, zero crossings of cells 1 and 4 within 1 ms."""
    want = np.genfromtxt(shared / "reference" / f"{name}.csv", delimiter=",", names=True)
    straw, steady_pa, deployed = RUNS[name]
    time_s = np.concatenate([[0.0], want["t_s"]])
    got = simulate(straw, lambda t: steady_pa * (1 - np.exp(-50 * t)), time_s, deployed)
    for channel, tolerance in (("x_m", 10e-6), ("z_m", 10e-6), ("phi_rad", 0.3e-3)):
        assert np.sqrt(np.mean((getattr(got, channel)[1:] - want[channel]) ** 2)) < tolerance
    for cell in (1, 4):
        ours = crossing_s(got.time_s, got.zeta_m[:, cell - 1, 1])
        theirs = crossing_s(want["t_s"], want[f"zeta_{cell}_2_m"])
        assert abs(ours - theirs) < 1e-3


def test_a_smaller_tolerance_changes_the_run_by_less_than_the_tolerance_allows() -> None:
    straw, steady_pa, deployed = RUNS["fold"]
    time_s = np.arange(0, 2, 1 / 240)
    coarse, fine = (
        simulate(straw, lambda t: steady_pa * (1 - np.exp(-50 * t)), time_s, deployed, tolerance_m=t)
        for t in (1e-6, 1e-8)
    )
    assert np.sqrt(np.mean((coarse.z_m - fine.z_m) ** 2)) < 10e-6


def test_a_straw_at_rest_stays_at_rest_in_both_forms() -> None:
    for form in ("truncated", "full"):
        straw = FOLDING.replace(form=form)
        run = simulate(straw, lambda t: 0 * t, np.linspace(0, 1, 11), [1, 4])
        assert np.ptp(run.x_m) < 1e-9
        assert np.ptp(run.z_m) < 1e-9
        assert run.pressure_pa == pytest.approx(0, abs=1e-3)


def test_the_full_form_with_stiff_odd_frusta_moves_like_the_truncated_form() -> None:
    """Odd frusta a hundred times stiffer are all but rigid, which is what the truncated form assumes."""
    stiff = FOLDING.replace(form="full", E_pa=[0.92e11, 0.92e9])
    time_s = np.arange(0, 2, 1 / 240)
    full, truncated = (simulate(s, lambda t: -25e3 * (1 - np.exp(-50 * t)), time_s, [1, 4]) for s in (stiff, FOLDING))
    snap_full, snap_truncated = (crossing_s(r.time_s, r.zeta_m[:, 0, 1]) for r in (full, truncated))
    assert snap_full == pytest.approx(snap_truncated, rel=0.02)
    assert np.abs(full.x_m - truncated.x_m)[time_s < 0.5].max() < 50e-6


def test_volume_follows_the_cells_and_inside_pressure_lags_while_fluid_flows() -> None:
    run = simulate(FOLDING, lambda t: -25e3 * (1 - np.exp(-50 * t)), np.arange(0, 2, 1 / 240), [1, 4])
    np.testing.assert_allclose(run.volume_m3, 5.24067e-4 * run.zeta_m.sum(axis=(1, 2)), rtol=1e-5)
    emptying = np.diff(run.volume_m3) < -1e-10
    assert emptying.any()
    # equation 2: while the straw empties the pressure inside is above the one outside the channel
    assert np.all(run.pressure_pa[1:][emptying] > run.external_pa[1:][emptying])


@pytest.mark.parametrize("cells", [1, 2, 30, 100])
def test_straws_of_one_cell_and_of_many_run(cells: int) -> None:
    run: Prediction = simulate(
        FOLDING.replace(cells=cells), lambda t: -25e3 * np.clip(t / 0.1, 0, 1), np.linspace(0, 0.5, 50), [1]
    )
    assert run.zeta_m.shape == (50, cells, 2)
    assert np.all(np.isfinite(run.x_m))


def test_stepping_through_a_run_ends_where_simulating_it_at_once_does() -> None:
    ramp = -25e3
    twin = Stepper(FOLDING, [1, 4])
    knots = np.linspace(0, 1, 101)
    for before, after in itertools.pairwise(knots):
        twin.advance(float(after), ramp * float(before), ramp * float(after))
    whole = simulate(FOLDING, lambda t: ramp * t, knots, [1, 4])
    x, z, phi = twin.tip
    assert x == pytest.approx(whole.x_m[-1], abs=1e-6)
    assert z == pytest.approx(whole.z_m[-1], abs=1e-6)
    assert phi == pytest.approx(whole.phi_rad[-1], abs=1e-4)
    assert twin.volume_m3 == pytest.approx(whole.volume_m3[-1], rel=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_a_stepper_at_rest_stays_at_rest(seed: int) -> None:
    # At rest Newton's corrections are rounding errors and shrink no further; an emulator left running must not fail.
    twin, random, before_pa = Stepper(FOLDING, [1, 4]), np.random.default_rng(seed), 0.0
    rest = twin.tip
    for k in range(1, 4000):
        pressure_pa = 1e-12 * float(random.standard_normal())
        twin.advance(k * 1e-3, before_pa, pressure_pa)
        before_pa = pressure_pa
    assert twin.tip == pytest.approx(rest, abs=1e-9)


def test_a_stepper_does_not_go_back_in_time() -> None:
    twin = Stepper(FOLDING, [])
    twin.advance(0.1, 0.0, 0.0)
    with pytest.raises(ModelError, match="cannot go back"):
        twin.advance(0.05, 0.0, 0.0)


def test_a_pressure_with_a_gap_is_refused_with_its_time() -> None:
    with pytest.raises(ModelError, match=r"not a number at 0\.5"):
        simulate(FOLDING, lambda t: np.where(t < 0.5, 0.0, np.nan), np.linspace(0, 1, 10), [])


def test_times_that_do_not_increase_are_refused() -> None:
    with pytest.raises(ModelError, match="increasing"):
        simulate(FOLDING, lambda t: 0 * t, np.array([0.0, 0.0, 1.0]), [])


def test_constants_that_the_integrator_cannot_follow_are_an_error_and_never_hang() -> None:
    """Without damping and channel nothing prevents a frustum from swinging through its neighbours."""
    wild = FOLDING.replace(c_zeta_n_s_per_m=0.0, c_phi_n_m_s_per_rad=0.0, r_ch_m=1.0)
    with pytest.raises(ModelError, match="out of range"):
        simulate(wild, lambda t: -25e3 * (1 - np.exp(-50 * t)), np.linspace(0, 2, 480), [1, 4])
