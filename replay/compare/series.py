"""Compares signals of two origins: their difference where both have samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.errors import ReplayError
from straw.replay.metrics import Metrics, metrics_of
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """One signal of a run: times and values (n,), standard uncertainty (n,), NaN where unknown, and its unit."""

    time_s: Floats
    value: Floats
    sigma: Floats
    unit: str


def tip_series(tip: TipTrace, shift_s: float = 0.0) -> dict[str, Series]:
    """X, Z and Phi at valid samples, times moved by a shift."""
    valid = tip.valid
    return {
        name: Series(
            tip.time_s[valid] + shift_s, getattr(tip, field)[valid], getattr(tip, f"sigma_{field}")[valid], unit
        )
        for name, field, unit in (("X", "x_m", "m"), ("Z", "z_m", "m"), ("Phi", "phi_rad", "rad"))
    }


def differ(a: Series, b: Series, name: str) -> Metrics:
    """b - a at a's times within what both cover; commands are held, all else is interpolated linearly."""
    inside = (a.time_s >= b.time_s[0]) & (a.time_s <= b.time_s[-1])
    if not np.any(inside):
        raise ReplayError(f"{name}: the two runs do not overlap in time; check their zero_time_ns")
    time_s = a.time_s[inside]
    at: Callable[[Floats], Floats] = lambda values: np.interp(time_s, b.time_s, values)  # noqa: E731
    if name == "command":
        before = np.searchsorted(b.time_s, time_s, side="right") - 1
        at = lambda values: values[before]  # noqa: E731
    sigma = np.hypot(a.sigma[inside], at(b.sigma))
    return metrics_of(time_s, a.value[inside], np.where(sigma > 0, sigma, math.nan), at(b.value))
