"""Plausibility of a recording: magnitudes of units, noise against motion, pressure and tip at the same time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.compare.comparison import CHANNELS
from straw.replay.errors import ReplayError
from straw.rig.run import PressureLog, Run
from straw.rig.tables.units import PLAUSIBLE, UNITS, largest, looks_like
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

#: Atmospheric pressure where people work, Pa: from 1900 m above sea level to the highest weather. A gauge that starts
#: there and never comes near zero shows absolute pressure.
AIR_PA = (80e3, 108.5e3)
#: Thirty readings of normal noise span 4.1 ± 0.7 deviations, more readings more: a span below two is implausible.
SPANS_SIGMAS = 2.0
#: Least share of the tip's samples with a pressure; without one there is nothing to predict from.
TOGETHER = 0.5


def check_plausible(run: Run) -> None:
    """Raise ReplayError where a gathered run's pressure, tip or sigma has an implausible magnitude, with what it looks
    like, or where pressure and tip were hardly recorded at the same time."""
    tip, log = run.tip, run.pressure
    assert tip is not None
    assert log is not None
    _check_together(run, log.time_s, tip.time_s[tip.valid])
    for name, quantity in (("x_m", "length"), ("z_m", "length"), ("phi_rad", "angle")):
        _check_size(run, f"/tip/state {name}", getattr(tip, name)[tip.valid], quantity)
    _check_pressure(run, log, tip)
    for channel in CHANNELS:
        values = getattr(tip, channel)[tip.valid]
        stated = getattr(tip, f"sigma_{channel}")[tip.valid]
        sigma = float(np.median(stated[np.isfinite(stated)])) if np.isfinite(stated).any() else 0.0
        if len(values) >= 30 and float(np.ptp(values)) < SPANS_SIGMAS * sigma:
            raise ReplayError(
                f"{run.path}: /tip/state sigma_{channel} is {sigma:.3g}, and {channel} spans {np.ptp(values):.3g} in "
                f"all, less than such noise: write it in {channel.rpartition('_')[2]}"
            )


def _check_size(run: Run, what: str, values: Floats, quantity: str) -> None:
    size, unit = largest(values), next(iter(UNITS[quantity]))
    if size <= PLAUSIBLE[quantity][1]:
        return
    others = [one for one in looks_like(values, quantity) if one != unit]
    raise ReplayError(f"{run.path}: {what} is up to {size:g} {unit}; {_cure(others, unit)}")


def _check_pressure(run: Run, log: PressureLog, tip: TipTrace) -> None:
    _check_size(run, "/pressure/measured", log.pressure_pa, "pressure")
    size = largest(log.pressure_pa)
    moved = max(float(np.ptp(getattr(tip, name)[tip.valid])) for name in ("x_m", "z_m"))
    if 0 < size < PLAUSIBLE["pressure"][0] and moved > PLAUSIBLE["length"][0]:
        others = [one for one in looks_like(log.pressure_pa, "pressure") if one != "Pa"]
        raise ReplayError(
            f"{run.path}: the tip moves {1e3 * moved:.2g} mm and /pressure/measured is {size:.3g} Pa at most; "
            f"{_cure(others, 'Pa')}"
        )
    low, high = AIR_PA
    if low <= log.pressure_pa[0] <= high and float(np.min(log.pressure_pa)) > low / 2:
        raise ReplayError(
            f"{run.path}: /pressure/measured begins at {log.pressure_pa[0] / 1e3:.4g} kPa and is never near zero; it "
            "looks absolute: record gauge pressure, or subtract atmospheric pressure"
        )


def _cure(others: list[str], unit: str) -> str:
    looks = f"it looks like {' or '.join(others[:2])}: " if others else ""
    return f"{looks}write it in {unit}, or import it again with straw import, which converts units"


def _check_together(run: Run, pressure_s: Floats, tip_s: Floats) -> None:
    here = float(np.mean((tip_s >= pressure_s[0]) & (tip_s <= pressure_s[-1])))
    if here < TOGETHER:
        raise ReplayError(
            f"{run.path}: the tip was recorded from {tip_s[0]:.6g} to {tip_s[-1]:.6g} s and the pressure from "
            f"{pressure_s[0]:.6g} to {pressure_s[-1]:.6g} s: {100 * here:.0f} % of the tip has a pressure; check both "
            "clocks, or leave the run out"
        )
