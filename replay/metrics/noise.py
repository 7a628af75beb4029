"""How many independent samples a correlated residual is worth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def autocorrelation(values: Floats) -> Floats:
    """Autocorrelation (k,) about the mean, from lag 0 to the last before it first turns negative; [1] if constant."""
    centred = values - values.mean()
    size = 2 ** int(np.ceil(np.log2(2 * len(values))))
    power = np.abs(np.fft.rfft(centred, size)) ** 2
    covariance = np.fft.irfft(power, size)[: len(values)]
    if not covariance[0] > 1e-24 * np.mean(values**2) * len(values):
        return np.ones(1)
    rho = covariance / covariance[0]
    negative = np.flatnonzero(rho <= 0)
    return np.asarray(rho[: negative[0]] if negative.size else rho)


def independent(values: Floats, *, squares: bool = False) -> float:
    """Independent samples that (n,) correlated ones are worth for their mean, or for their mean square.

    n / (1 + 2 sum rho_k) (Bayley and Hammersley 1946), and with rho_k^2 for squares of Gaussian noise.
    """
    rho = autocorrelation(values)[1:]
    return float(max(1.0, len(values) / (1 + 2 * np.sum(rho**2 if squares else rho))))
