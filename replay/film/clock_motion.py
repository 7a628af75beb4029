"""The camera's clock from the motion itself: the shift at which the tip moves as the model predicts.

A substitute where there is no LED. It relies on the model: a straw that responds later than predicted shifts the clock
by as much, so a clock from the motion must not be used to find a delay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.compare.driving import driving_pressure
from straw.replay.errors import ReplayError
from straw.rig.camera_clock import CameraClock
from straw.rig.run import Run
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

RATE_HZ = 240.0
ARM_M = 0.1  # angles are weighted with the straw's length as lever arm


def clock_from_motion(run: Run, tip: TipTrace, straw: StrawParameters) -> CameraClock:
    """Fit ``t_track = a + t_host`` of a track whose times may be off by any amount; b is fixed at 1.

    Raises ReplayError where nothing moves, or the run cannot be predicted.
    """
    if run.pressure is None or run.initial_deployed is None:
        raise ReplayError(f"{run.path}: its pressure and its initial state are needed to predict the motion")
    host_s = np.arange(run.pressure.time_s[0], run.pressure.time_s[-1], 1 / RATE_HZ)
    p = simulate(straw, driving_pressure(run.pressure, run.command), host_s, run.initial_deployed)
    predicted = np.column_stack([p.x_m, p.z_m, ARM_M * p.phi_rad])
    valid = tip.valid
    seen_s = tip.time_s[valid]
    seen = np.column_stack([tip.x_m[valid], tip.z_m[valid], ARM_M * tip.phi_rad[valid]])
    if len(seen_s) < 10 or np.ptp(predicted, axis=0).max() < 1e-4:
        raise ReplayError(f"{run.path}: the tip hardly moves, so its motion does not show the delay; use an LED")

    def misfit(shift_s: float) -> float:
        at_s = seen_s - shift_s
        error = seen - np.column_stack([np.interp(at_s, host_s, axis) for axis in predicted.T])
        error -= np.median(error, axis=0)  # an offset of position belongs to the camera's place, not to the clock
        return float(np.mean(np.sum(error**2, axis=1)))

    coarse_s = _coarse_shift(host_s, predicted, seen_s, seen)
    around = coarse_s + np.arange(-0.3, 0.3, 1 / RATE_HZ)
    start_s = float(around[int(np.argmin([misfit(shift) for shift in around]))])
    best = minimize_scalar(misfit, bounds=(start_s - 0.01, start_s + 0.01), method="bounded", options={"xatol": 1e-6})
    shift_s = float(best.x)
    at_s = seen_s - shift_s
    speed = np.column_stack([np.interp(at_s, host_s, np.gradient(axis, host_s)) for axis in predicted.T])
    power = float(np.sum(speed**2))
    # A model's misfit is not white: samples within a tenth of a second count as one.
    alike = max(0.1 / float(np.median(np.diff(seen_s))), 1.0)
    sigma_s = float(np.sqrt(misfit(shift_s) * alike / power))
    residual_s = float(np.sqrt(misfit(shift_s) * len(seen_s) / power))
    return CameraClock(shift_s, 1.0, sigma_s, 0.0, residual_s, len(seen_s), "motion")


def _coarse_shift(host_s: Floats, predicted: Floats, seen_s: Floats, seen: Floats) -> float:
    """The shift at which the speeds of both correlate best, to a frame."""
    from scipy.signal import fftconvolve

    grid_s = np.arange(seen_s[0], seen_s[-1], 1 / RATE_HZ)
    moved = np.column_stack([np.interp(grid_s, seen_s, axis) for axis in seen.T])
    width = 12  # a twentieth of a second: over a shorter time noise dominates the difference
    a, b = (np.linalg.norm(x[width:] - x[:-width], axis=1) for x in (moved, predicted))
    correlation = fftconvolve(a - a.mean(), (b - b.mean())[::-1], mode="full")
    lag = int(np.argmax(correlation)) - (len(b) - 1)
    return float(grid_s[0] + lag / RATE_HZ - host_s[0])
