"""How far a prediction is from a measurement, signal by signal; no single number does, so several are kept together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """Figures of one signal; lengths in the signal's own unit, residual = predicted - measured."""

    n: int
    bias: float
    rmse: float
    nrmse_of_range: float
    max_abs: float
    max_at_s: float
    within_2_sigma: float
    reduced_chi2: float


def metrics_of(time_s: Floats, measured: Floats, sigma: Floats, predicted: Floats) -> Metrics:
    """Metrics over samples (n,) that are all finite; sigma NaN where unknown gives NaN for what needs it.

    ``nrmse_of_range`` is the RMSE over max - min of the measurement. ``reduced_chi2`` takes samples as independent:
    it is a measure of misfit in sigmas, not a test.
    """
    residual = predicted - measured
    worst = int(np.argmax(np.abs(residual)))
    rmse = float(np.sqrt(np.mean(residual**2)))
    extent = float(np.ptp(measured))
    scaled = residual / sigma
    known = bool(np.all(np.isfinite(scaled)))
    return Metrics(
        n=len(residual),
        bias=float(residual.mean()),
        rmse=rmse,
        nrmse_of_range=rmse / extent if extent > 0 else float("nan"),
        max_abs=float(abs(residual[worst])),
        max_at_s=float(time_s[worst]),
        within_2_sigma=float(np.mean(np.abs(scaled) <= 2)) if known else float("nan"),
        reduced_chi2=float(np.mean(scaled**2)) if known else float("nan"),
    )
