"""Frequency and decay of a ring-down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]

#: Least amplitude over the residual, and least number of samples, of a ring-down with a frequency.
LEAST_SIGMA, LEAST_SAMPLES = 4.0, 24
LONGEST_S = 1.0


@dataclass(frozen=True)
class RingDown:
    """A exp(-decay t) cos(2 pi f t + phase), on a parabola: f (Hz) and decay (1/s) with standard uncertainties."""

    frequency_hz: float
    frequency_sigma_hz: float
    decay_per_s: float
    decay_sigma_per_s: float
    amplitude: float


def ring_down(time_s: Floats, values: Floats) -> RingDown | None:
    """Least-squares fit to samples (n,) of a free motion; None where no oscillation exceeds the residual."""
    if len(time_s) < LEAST_SAMPLES:
        return None
    t = time_s - time_s[0]
    flat = values - np.polyval(np.polyfit(t, values, 2), t)
    scale = float(flat.std())
    if not scale > 1e-12 * np.abs(values).max():
        return None
    nyquist = 0.5 * (len(t) - 1) / t[-1]
    # at least two periods: slower motion belongs to the parabola
    bounds = ([2.0 / t[-1], 0.0], [nyquist, 0.5 * nyquist])

    def columns(x: Floats) -> Floats:
        fading = np.exp(-x[1] * t)
        turn = 2 * np.pi * x[0] * t
        return np.column_stack([fading * np.cos(turn), fading * np.sin(turn), np.ones_like(t), t, t**2])

    def misfit(x: Floats) -> Floats:
        a = columns(x)
        linear, *_ = np.linalg.lstsq(a, values, rcond=None)  # amplitudes are linear, given frequency and decay
        return np.asarray((a @ linear - values) / scale)

    tries = [
        least_squares(misfit, np.clip(start, *bounds), bounds=bounds, x_scale=start)
        for start in _starts(t, flat, bounds[0][0])
    ]
    found = min(tries, key=lambda one: float(one.cost))
    linear, *_ = np.linalg.lstsq(columns(found.x), values, rcond=None)
    amplitude, left = float(np.hypot(*linear[:2])), scale * float(np.sqrt(np.mean(found.fun**2)))
    if not amplitude > LEAST_SIGMA * left or found.x[1] > np.pi * found.x[0]:
        return None  # noise, or a motion that decays within two swings
    jacobian = np.asarray(found.jac, dtype=np.float64)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * np.sum(found.fun**2) / (len(t) - 7)
    f_sigma, decay_sigma = np.sqrt(np.diag(covariance))
    return RingDown(float(found.x[0]), float(f_sigma), float(found.x[1]), float(decay_sigma), amplitude)


def _starts(t: Floats, flat: Floats, slowest_hz: float) -> list[list[float]]:
    """Starting values of frequency and decay: spectral peaks of the whole record and of its beginnings."""
    starts = []
    for share in (1.0, 0.4, 0.15):
        n = max(LEAST_SAMPLES, round(share * len(t)))
        power = np.abs(np.fft.rfft(flat[:n] - flat[:n].mean(), 8 * n)) ** 2
        frequency = np.fft.rfftfreq(8 * n, t[-1] / (len(t) - 1))
        seen = frequency > slowest_hz
        starts.append([float(frequency[seen][np.argmax(power[seen])]), 3.0 / float(t[n - 1])])
    return starts
