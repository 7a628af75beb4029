"""Metrics of one signal: size, shape and timing of a misfit, and the share that noise explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.metrics.lag import lag_of
from straw.replay.metrics.noise import independent

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """Figures of one signal in its own unit; residual = predicted - measured. NaN where something is unknown.

    ``overlap_s``: seconds in which both have samples. ``nrmse_of_range``: RMSE over max - min of the measurement.
    ``sprague_geers_*``: magnitude M, phase P, comprehensive C. ``lag_s`` > 0: the prediction is late; ``lag_at_bound``:
    the lag is beyond the search range. ``reduced_chi2_sigma``: standard deviation of the reduced chi-square about 1
    for noise with the residual's correlation.
    """

    n: int
    overlap_s: float
    bias: float
    bias_sigma: float
    rmse: float
    nrmse_of_range: float
    max_abs: float
    max_at_s: float
    sprague_geers_m: float
    sprague_geers_p: float
    sprague_geers_c: float
    lag_s: float
    lag_sigma_s: float
    lag_bound_s: float
    lag_at_bound: bool
    rmse_after_lag: float
    within_2_sigma: float
    reduced_chi2: float
    reduced_chi2_sigma: float


def metrics_of(time_s: Floats, measured: Floats, sigma: Floats, predicted: Floats) -> Metrics:
    """Metrics over samples (n,) that are all finite; sigma NaN where unknown gives NaN for what needs it."""
    residual = predicted - measured
    worst = int(np.argmax(np.abs(residual)))
    rmse = float(np.sqrt(np.mean(residual**2)))
    extent = float(np.ptp(measured))
    scaled = residual / sigma
    known = bool(np.all(np.isfinite(scaled)))
    nan = float("nan")
    m, p, c = sprague_geers(measured, predicted)
    lag = lag_of(time_s, measured, predicted)
    steps_s = np.diff(time_s)
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    return Metrics(
        n=len(residual),
        overlap_s=float(np.sum(np.minimum(steps_s, 2.5 * usual_s))),
        bias=float(residual.mean()),
        bias_sigma=float(residual.std() / np.sqrt(independent(residual))),
        rmse=rmse,
        nrmse_of_range=rmse / extent if extent > 0 else nan,
        max_abs=float(abs(residual[worst])),
        max_at_s=float(time_s[worst]),
        sprague_geers_m=m,
        sprague_geers_p=p,
        sprague_geers_c=c,
        lag_s=lag.value_s,
        lag_sigma_s=lag.sigma_s,
        lag_bound_s=lag.bound_s,
        lag_at_bound=lag.at_bound,
        rmse_after_lag=lag.rmse_after,
        within_2_sigma=float(np.mean(np.abs(scaled) <= 2)) if known else nan,
        reduced_chi2=float(np.mean(scaled**2)) if known else nan,
        reduced_chi2_sigma=float(np.sqrt(2 / independent(scaled, squares=True))) if known else nan,
    )


def sprague_geers(measured: Floats, predicted: Floats) -> tuple[float, float, float]:
    """Magnitude, phase and comprehensive error of samples (n,) evenly spaced (Sprague and Geers 2004)."""
    return sprague_geers_from(
        float(np.mean(measured**2)), float(np.mean(predicted**2)), float(np.mean(measured * predicted))
    )


def sprague_geers_from(measured2: float, predicted2: float, both: float) -> tuple[float, float, float]:
    """The same from the integrals psi_aa, psi_bb and psi_ab; NaN where a signal is zero throughout."""
    if not (measured2 > 0 and predicted2 > 0):
        return float("nan"), float("nan"), float("nan")
    m = float(np.sqrt(predicted2 / measured2) - 1)
    p = float(np.arccos(np.clip(both / np.sqrt(measured2 * predicted2), -1, 1)) / np.pi)
    return m, p, float(np.hypot(m, p))
