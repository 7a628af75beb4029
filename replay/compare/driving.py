"""The pressure that drives a prediction: the measured pressure as a function of time."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from straw.rig.run import PressureLog

Floats = NDArray[np.float64]


def driving_pressure(measured: PressureLog, command: PressureLog | None) -> Callable[[Floats], Floats]:
    """Measured pressure (Pa) as a function of seconds since the run's zero; constant outside the log.

    Readings are joined by a monotone cubic, which adds no overshoot; straight lines would delay a controller that
    settles with time constant tau by h^2 / (12 tau), 0.4 ms of 20 ms at 100 Hz. At a command a new cubic starts from
    the last reading, as the controller holds until then. Only the command's time is used, never its value.
    """
    time_s, pressure_pa = measured.time_s, measured.pressure_pa
    if len(time_s) == 1:
        return measured
    told = command.time_s[1:][np.diff(command.pressure_pa) != 0] if command else np.empty(0)
    told = told[(told > time_s[0]) & (told < time_s[-1])]
    edges = np.concatenate([time_s[:1], told, time_s[-1:]])
    curves = []
    for start_s, end_s in itertools.pairwise(edges):
        held_pa = pressure_pa[np.searchsorted(time_s, start_s, side="right") - 1]
        inside = (time_s > start_s) & (time_s < end_s)
        knots_pa = np.concatenate([[held_pa], pressure_pa[inside]])
        last_pa = pressure_pa[-1] if end_s == time_s[-1] else knots_pa[-1]
        knots_s = np.concatenate([[start_s], time_s[inside], [end_s]])
        curves.append(PchipInterpolator(knots_s, np.append(knots_pa, last_pa)))

    def pressure(at_s: Floats) -> Floats:
        at_s = np.clip(np.asarray(at_s, dtype=np.float64), time_s[0], time_s[-1])
        which = np.searchsorted(told, at_s, side="right")
        out = np.empty_like(at_s)
        for k, curve in enumerate(curves):
            out[which == k] = curve(at_s[which == k])
        return out

    return pressure
