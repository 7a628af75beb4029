"""Smooths a gauge's readings where the pressure is steady, and nowhere else."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from straw.rig.run import PressureLog

Floats = NDArray[np.float64]

#: Half widths of the windows tried, in readings.
HALF_WIDTHS = (1, 2, 4, 8, 16, 32, 64)
#: A wider mean is rejected if it differs from a narrower one by more than so many of the narrower's sigmas.
APART = 2.5


def quieted(measured: PressureLog, command: PressureLog | None) -> PressureLog:
    """The log with each reading replaced by the mean of the widest window that only noise distinguishes from all
    narrower ones (Lepski's rule), within what lies between two commands. The noise is estimated from second
    differences.
    """
    pressure_pa = measured.pressure_pa
    if len(pressure_pa) < 4:
        return measured
    # of normal noise: 1.4826 median deviations are one sigma, and a second difference has 1 + 4 + 1 variances
    sigma_pa = 1.4826 * float(np.median(np.abs(np.diff(pressure_pa, 2)))) / np.sqrt(6)
    told = command.time_s[1:][np.diff(command.pressure_pa) != 0] if command else np.empty(0)
    edges = np.concatenate([[0], np.searchsorted(measured.time_s, told), [len(pressure_pa)]])
    out = pressure_pa.copy()
    for a, b in itertools.pairwise(np.unique(edges)):
        out[a:b] = _steady(pressure_pa[a:b], sigma_pa)
    return PressureLog(measured.time_s, out, measured.sigma_pa)


def _steady(readings: Floats, sigma: float) -> Floats:
    """Readings (n,) of one interval, each averaged as widely as noise of this sigma allows; windows shrink at ends."""
    n = len(readings)
    total = np.concatenate([[0.0], np.cumsum(readings)])
    best, open_ = readings.copy(), np.ones(n, dtype=bool)
    low, high = readings - APART * sigma, readings + APART * sigma
    for half in HALF_WIDTHS:
        reach = np.minimum(half, np.minimum(np.arange(n), np.arange(n)[::-1]))
        width = 2 * reach + 1
        mean = (total[np.arange(n) + reach + 1] - total[np.arange(n) - reach]) / width
        open_ &= (mean >= low) & (mean <= high)
        best = np.where(open_, mean, best)
        low = np.maximum(low, mean - APART * sigma / np.sqrt(width))
        high = np.minimum(high, mean + APART * sigma / np.sqrt(width))
    return best
