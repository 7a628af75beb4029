"""A prediction is driven by the measured pressure, changing when commanded, and compared where the tip is valid."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.compare.comparison import compare
from straw.replay.compare.driving import driving_pressure
from straw.replay.errors import ReplayError
from straw.rig.run import PressureLog, Run
from straw.tracking.trace import TipTrace

STRAW = StrawParameters()


def log(time_s: np.ndarray, pressure_pa: np.ndarray, *, held: bool = False) -> PressureLog:
    return PressureLog(time_s, pressure_pa, np.full(len(time_s), np.nan), held)


def run_of(pressure: PressureLog, tip: TipTrace | None, command: PressureLog | None = None) -> Run:
    return Run(
        path=Path("made.mcap"), sha256="", run_id="made", specimen="", initial_deployed=(1, 4), cycle=0, cells=9,
        zero_time_ns=0, metadata={}, attachments={}, command=command, pressure=pressure, tip=tip, predictions={},
        events=(), lost=(),
    )  # fmt: skip


def test_the_pressure_is_held_until_the_command_that_changes_it() -> None:
    """Readings every 10 ms, a step commanded 8 ms after one of them: four fifths of that interval precede the step."""
    read = log(np.array([0.0, 0.01, 0.02, 0.03]), np.array([0.0, 0.0, -1e3, -2e3]))
    told = log(np.array([0.0, 0.018]), np.array([0.0, -25e3]), held=True)
    driving = driving_pressure(read, told)
    assert driving(np.array([0.005, 0.015, 0.018])) == pytest.approx([0.0, 0.0, 0.0])
    assert driving(np.array([0.02, 0.03, 1.0])) == pytest.approx([-1e3, -2e3, -2e3])
    between = driving(np.linspace(0.018, 0.03, 50))
    assert np.all(np.diff(between) < 0)
    assert between.min() > -2.001e3  # the commanded value is never used


def test_commands_outside_the_readings_change_nothing() -> None:
    read = log(np.array([0.0, 0.01, 0.02]), np.array([0.0, 0.0, -1e3]))
    told = log(np.array([-1.0, -0.5, 0.5]), np.array([0.0, -25e3, 0.0]), held=True)
    at = np.linspace(-0.01, 0.03, 41)
    np.testing.assert_array_equal(driving_pressure(read, told)(at), driving_pressure(read, None)(at))


def test_a_settling_controller_read_at_100_hz_is_followed_without_delay() -> None:
    """Delay of a step = area between the curves over its height; interpolation is 0.4 ms late, a sample is 10 ms."""
    start_s, tau_s, step_pa = 0.103, 0.02, -25e3
    fine = np.arange(0.0, 0.4, 1e-5)
    truth = np.where(fine < start_s, 0.0, step_pa * -np.expm1(-(fine - start_s) / tau_s))
    delays = []
    for phase_s in [*np.arange(0.0, 0.01, 0.001), start_s % 0.01]:  # the last: a reading at the step's command
        at = np.arange(phase_s, 0.4, 0.01)
        told = log(np.array([0.0, start_s]), np.array([0.0, step_pa]), held=True)
        driving = driving_pressure(log(at, np.interp(at, fine, truth)), told)
        delays.append(np.trapezoid(driving(fine) - truth, fine) / -step_pa)
    assert np.abs(delays).max() < 0.15e-3


def recorded(straw: StrawParameters) -> tuple[Run, np.ndarray]:
    """A run made with the model itself; its tip starts later than its pressure and is invalid for a while."""
    time_s = np.arange(0.0, 1.0, 1 / 240)
    pressure = log(np.arange(-0.1, 1.0, 0.005), np.interp(np.arange(-0.1, 1.0, 0.005), [0, 0.1], [0, -25e3]))
    p = simulate(straw, pressure, np.concatenate([[-0.1], time_s]), (1, 4))
    valid = (time_s < 0.3) | (time_s > 0.4)
    x, z, phi = (np.where(valid, getattr(p, name)[1:], np.nan) for name in ("x_m", "z_m", "phi_rad"))
    sigma = np.full(len(time_s), 1e-5)
    tip = TipTrace(time_s, x, z, phi, sigma, sigma, sigma, valid, np.arange(len(time_s)))
    return run_of(pressure, tip), valid


def test_a_run_made_by_the_model_leaves_no_residual() -> None:
    run, valid = recorded(STRAW)
    signals = compare(run, STRAW).signals
    for signal in signals.values():
        assert signal.metrics.n == valid.sum()
        # of a motion of 10 mm and 0.3 rad: interpolation error of readings every 5 ms at the two corners of the ramp
        assert signal.metrics.nrmse_of_range < 1e-3


def test_a_planted_offset_of_the_tip_is_found_as_bias() -> None:
    run, _ = recorded(STRAW)
    assert run.tip is not None
    moved = dataclasses.replace(run, tip=dataclasses.replace(run.tip, x_m=run.tip.x_m - 1e-4))
    assert compare(moved, STRAW).signals["x_m"].metrics.bias == pytest.approx(1e-4, rel=0.05)


def test_a_wrong_channel_radius_shows_as_residual() -> None:
    run, _ = recorded(STRAW)
    assert compare(run, STRAW.replace(r_ch_m=0.3e-3)).signals["x_m"].metrics.rmse > 1e-4


def test_a_straw_with_another_number_of_cells_is_refused() -> None:
    run, _ = recorded(STRAW)
    with pytest.raises(ReplayError, match="9 cells"):
        compare(run, STRAW.replace(cells=5))
