"""By how much a prediction is late, with its uncertainty, within less than half a period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from straw.replay.metrics.noise import independent

Floats = NDArray[np.float64]

#: Lags searched: beyond half a period another cycle fits as well; beyond a quarter of the record little is left.
OF_PERIOD, OF_RECORD = 0.45, 0.25
GRID = 121


@dataclass(frozen=True)
class Lag:
    """``value_s`` > 0 where the prediction is late. NaN where the motion is too small for an estimate.

    ``at_bound``: the best match lies at or beyond the limit of the search, so the value is not an estimate.
    """

    value_s: float
    sigma_s: float
    bound_s: float
    at_bound: bool
    rmse_after: float


UNKNOWN = Lag(float("nan"), float("nan"), float("nan"), False, float("nan"))


def lag_of(time_s: Floats, measured: Floats, predicted: Floats) -> Lag:
    """Delay that brings a prediction (n,) closest to a measurement (n,) in least squares, times (n,) increasing.

    Sigma is first-order: residual after the shift, with its correlation, over the prediction's rate of change.
    """
    span_s = time_s[-1] - time_s[0]
    if len(time_s) < 8 or np.ptp(predicted) <= 1e-12 * np.abs(predicted).max():
        return UNKNOWN
    bound_s = min(OF_PERIOD * period_of(time_s, predicted), OF_RECORD * span_s)
    curve = CubicSpline(time_s, predicted)

    def both(late_s: float) -> slice:
        """Samples that have a prediction when it is moved."""
        return slice(*np.searchsorted(time_s, [time_s[0] - late_s, time_s[-1] - late_s]).tolist())

    def misfit(late_s: float) -> float:
        there = both(late_s)
        return float(np.mean((curve(time_s[there] + late_s) - measured[there]) ** 2))

    grid = np.linspace(-bound_s, bound_s, GRID)
    best = int(np.argmin([misfit(late_s) for late_s in grid]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]
    late_s = float(minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": 1e-3 * bound_s / GRID}).x)
    there = both(late_s)
    residual = curve(time_s[there] + late_s) - measured[there]
    rate = curve(time_s[there] + late_s, 1)
    worth = independent(residual) / len(residual)
    sigma_s = float(np.sqrt(np.sum(residual**2) / len(residual) / worth / np.sum(rate**2)))
    if not sigma_s < bound_s:
        return UNKNOWN
    at_bound = bool(bound_s - abs(late_s) < bound_s / GRID)
    return Lag(late_s, sigma_s, float(bound_s), at_bound, float(np.sqrt(np.mean(residual**2))))


def period_of(time_s: Floats, values: Floats) -> float:
    """Dominant period (s): where frequency times power peaks, which sees a ring-down on top of a slow ramp."""
    even_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    even = np.interp(even_s, time_s, values)
    line = np.polyval(np.polyfit(even_s - even_s[0], even, 1), even_s - even_s[0])
    power = np.abs(np.fft.rfft((even - line) * np.hanning(len(even)))) ** 2
    frequency_hz = np.fft.rfftfreq(len(even), (even_s[-1] - even_s[0]) / (len(even) - 1))
    return float(1 / frequency_hz[1 + np.argmax(frequency_hz[1:] * power[1:])])
