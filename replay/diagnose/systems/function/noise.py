"""Noise of readings and the rate of an input, estimated from the readings themselves."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Floats = NDArray[np.float64]

#: The window of an input's rate is the shortest in which noise makes at most this share of its deviation, and at most
#: this share of the recording.
RATE_NOISE, RATE_WINDOW = 0.1, 0.02
#: Readings of a window for the noise; the quieter half of all windows is used.
QUIET = 8
#: In a recording of fewer readings, most of which may be a transient, a fifth of windows half as long is used.
SHORT = 64
#: Windows of an input's rate, readings: odd, each some 1.4 times the last.
WINDOWS = (5, 7, 9, 11, 15, 21, 31, 45, 63)
#: Orders of differences for the noise.
ORDERS = (2, 3, 4, 6)


def noise_of(values: Floats) -> float:
    """Noise of readings (n,), one deviation: differences, and a converter's steps (one over root 12)."""
    good = values[np.isfinite(values)]
    gaps = np.abs(np.diff(good))
    # more than rounding; a converter's step is the smallest but for a few faulty, and shows in readings that repeat
    steps = gaps[gaps > 1e-12 * max(1.0, float(np.max(np.abs(good))))]
    step = float(np.quantile(steps, 0.02)) if len(steps) else 0.0
    white = min((w for w in (_white(good, order) for order in ORDERS if len(good) > order) if w), default=0.0)
    quantised = step / np.sqrt(12) if len(steps) < 0.9 * len(gaps) else 0.0
    return max(white, quantised, 1e-9 * float(np.ptp(good)), 1e-300)


def _white(values: Floats, order: int) -> float:
    """White noise from differences of an order; a smooth signal adds less to them the higher the order is."""
    squares = np.diff(values, order) ** 2 / comb(2 * order, order)
    few = len(squares) < SHORT
    if len(squares) < QUIET:
        return 0.0  # unknown: all of it may be a transient
    windows = np.array_split(squares, max(1, len(squares) // (QUIET // 2 if few else QUIET)))
    return float(np.sqrt(np.quantile([np.mean(w) for w in windows], 0.2 if few else 0.5)))


def rate(time_s: Floats, values: Floats) -> Floats:
    """Rate of an input (n,): the slope of a parabola over the shortest window in which noise does not dominate."""
    if np.ptp(values) == 0 or len(values) < 7:
        return np.asarray(np.gradient(values, time_s))
    step_s, noise = float(np.median(np.diff(time_s))), noise_of(values)
    even = np.arange(time_s[0], time_s[-1] + step_s / 2, step_s)
    y = np.interp(even, time_s, values)
    out = np.gradient(y, step_s)
    for window in WINDOWS:
        if window >= min(len(even), max(6, RATE_WINDOW * len(even))):
            break
        out = savgol_filter(y, window, 2, deriv=1, delta=step_s)
        # the slope of a line through n readings has 12 / n^3 of their variance
        if noise * np.sqrt(12 / window**3) / step_s < RATE_NOISE * np.std(out):
            break
    return np.asarray(np.interp(time_s, even, out))
