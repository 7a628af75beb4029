"""Moments at which a channel passes a level, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Crossing:
    """A channel passes a level: when, how fast (its unit a second), and that moment by each parameter (P,)."""

    time_s: float
    rate: float
    by: Floats
    cell: int | None = None


def crossings(time_s: Floats, value: Floats, rate: Floats, by: Floats) -> list[Crossing]:
    """Where value (n,) with this rate passes zero, ``by`` (n, P) its derivatives by the parameters.

    From the cubic through values and rates at neighbouring outputs: dt/dp = -(dg/dp) / (dg/dt).
    """
    found = []
    for i in np.flatnonzero((value[1:] > 0) != (value[:-1] > 0)):
        h = float(time_s[i + 1] - time_s[i])
        d, v0, v1 = value[i + 1] - value[i], rate[i] * h, rate[i + 1] * h
        roots = np.roots([v0 + v1 - 2 * d, 3 * d - 2 * v0 - v1, v0, value[i]])
        inside = [r.real for r in roots if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9]
        x = min(inside, default=-value[i] / d)
        slope = (v0 + x * (2 * (3 * d - 2 * v0 - v1) + 3 * x * (v0 + v1 - 2 * d))) / h
        # a shift in time changes slowly, while by and rate rise together in a snap
        shifts = [-by[k] / rate[k] if rate[k] else -by[k] / slope for k in (i, i + 1)]
        found.append(Crossing(float(time_s[i] + x * h), float(slope), (1 - x) * shifts[0] + x * shifts[1]))
    return found
