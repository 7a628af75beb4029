"""What drives the straw: the external pressure on a uniform grid, and how long a step may be that resolves it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.scheme import COEFFICIENTS, STAGES, TIMES

Floats = NDArray[np.float64]

#: What lasts shorter than this moves the straw by its impulse only, s.
FELT_S = 5e-3
#: A step this short is left to the control of its error, and each trial of a shorter one is this share of the last.
SHORT_S, SHORTER = 2.5e-4, 0.6


class Table(NamedTuple):
    """External pressure on a uniform grid, linear between its points, constant beyond them."""

    start_s: float
    step_s: float
    pressure_pa: Floats


@allocates_nothing
def pressure_in(table: Table, time_s: float) -> float:
    """External pressure at a time, Pa."""
    last = len(table.pressure_pa) - 1
    x = (time_s - table.start_s) / table.step_s
    if x <= 0 or last == 0:
        return float(table.pressure_pa[0])
    if x >= last:
        return float(table.pressure_pa[last])
    i = int(x)
    return float(table.pressure_pa[i] + (x - i) * (table.pressure_pa[i + 1] - table.pressure_pa[i]))


@compiled
def summed(table: Table) -> Floats:
    """Integral of the pressure from the table's start to each of its points, Pa s."""
    sums = np.zeros_like(table.pressure_pa)
    for i in range(1, len(sums)):
        sums[i] = sums[i - 1] + table.step_s * (table.pressure_pa[i - 1] + table.pressure_pa[i]) / 2
    return sums


@exposed
def summed_to(table: Table, sums: Floats, time_s: float) -> float:
    """Integral of the pressure from the table's start to a time, Pa s."""
    i = min(max(int((time_s - table.start_s) / table.step_s), 0), len(sums) - 1)
    at_s = table.start_s + i * table.step_s
    return float(sums[i] + (time_s - at_s) * (table.pressure_pa[i] + pressure_in(table, time_s)) / 2)


@exposed
def seen(table: Table, sums: Floats, time_s: float, step_s: float, within_pa: float) -> float:
    """The longest step (s) from a time, ``step_s`` or shorter, whose stages resolve the pressure: their weighted mean
    is that of the pressure itself. What falls between the stages would escape the step's error estimate as well."""
    while step_s > SHORT_S:
        weighed = 0.0
        for i in range(STAGES):
            weighed += COEFFICIENTS[STAGES - 1, i] * pressure_in(table, time_s + TIMES[i] * step_s)
        impulse = summed_to(table, sums, time_s + step_s) - summed_to(table, sums, time_s)
        if abs(weighed * step_s - impulse) <= within_pa * max(step_s, FELT_S):
            break
        step_s *= SHORTER
    return step_s
