"""The gauge's reading before the first command: a correct one reads zero on a vented line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import SECANT
from straw.replay.diagnose.systems.straw.constants import instrument_at
from straw.rig.run import PressureLog

Floats = NDArray[np.float64]

#: Standard uncertainty of a correct gauge's zero, Pa: 0.1 % of a range of 100 kPa, chosen without a manufacturer's
#: figure; an offset of three times as much is noticed in a single run.
VENTED_PA = 100.0
#: Least number of readings, and of standard errors by which an offset must differ from zero: a regulator that uses the
#: same gauge makes it read zero whatever its offset, so a zero reading is no evidence of a correct gauge.
FEWEST, APART = 10, 5.0


def vented(measured: PressureLog, command: PressureLog | None) -> float | None:
    """Mean reading (Pa) before the first command; None where noise may explain it, where it still changes, or where the
    commands are unknown."""
    if command is None:
        return None
    told = np.flatnonzero(command.pressure_pa != 0)
    until_s = command.time_s[told[0]] if len(told) else np.inf
    readings = measured.pressure_pa[measured.time_s < until_s]
    if len(readings) < FEWEST:
        return None
    halves = np.array_split(readings, 2)
    error = np.std(readings) / np.sqrt(len(readings))
    drift = abs(float(np.mean(halves[1]) - np.mean(halves[0])))
    mean = float(np.mean(readings))
    return mean if abs(mean) > APART * error and drift < APART * 2 * error else None


def vent_residual(
    vent_pa: float | None, start_s: float, unknowns: Sequence[Unknown], at: Floats
) -> tuple[float, Floats]:
    """The corrected gauge pressure of the vented line, in sigmas, and its derivatives by u."""
    slopes = np.zeros(len(unknowns))
    if vent_pa is None:
        return 0.0, slopes

    def left(u: Floats) -> float:
        true_pa = instrument_at(unknowns, u).true_pressure(np.array([vent_pa]), np.array([start_s]))
        return float(true_pa[0]) / VENTED_PA

    for k, unknown in enumerate(unknowns):
        if unknown.target.startswith("instrument.gauge"):
            step = SECANT * np.eye(len(unknowns))[k]
            slopes[k] = (left(at + step) - left(at - step)) / (2 * SECANT)
    return left(at), slopes
