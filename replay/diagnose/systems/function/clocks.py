"""Delays of inputs, and late clocks of channels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.codes import CLOCK, DELAY, OF_TIME
from straw.replay.diagnose.systems.function.compiled import compiled
from straw.replay.diagnose.systems.function.shapes import value

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@compiled
def inputs_at(k: int, share: float, late: Floats, t: Floats, inputs: Floats, out: Floats) -> None:
    """Inputs (rows, n) between samples k and k + 1, each delayed by its own number of seconds."""
    for i in range(len(out)):
        if late[i] == 0.0:
            out[i] = inputs[i, k] * (1 - share) + inputs[i, k + 1] * share
        else:
            at = t[k] * (1 - share) + t[k + 1] * share - late[i]
            j = min(max(np.searchsorted(t, at) - 1, 0), len(t) - 2)
            part = min(max((at - t[j]) / (t[j + 1] - t[j]), 0.0), 1.0)
            out[i] = inputs[i, j] * (1 - part) + inputs[i, j + 1] * part


@compiled
def warped(rows: Indices, p: Floats, t: Floats, ys: Floats) -> None:
    """Channels as clocks that are late show them, in place."""
    n = len(t)
    for m in range(len(rows)):
        if rows[m, 0] != CLOCK:
            continue
        own = ys[rows[m, 1]].copy()
        j = 0
        for k in range(n):
            s = t[k] if rows[m, 2] == OF_TIME else 1.0
            at = t[k] - value(rows[m, 4], p, rows[m, 5], rows[m, 6], s)
            while j < n - 2 and t[j + 1] < at:
                j += 1
            while j > 0 and t[j] > at:
                j -= 1
            part = min(max((at - t[j]) / (t[j + 1] - t[j]), 0.0), 1.0)
            ys[rows[m, 1], k] = own[j] * (1 - part) + own[j + 1] * part


@compiled
def delays(rows: Indices, p: Floats, inputs: int) -> Floats:
    """Delay of each input (inputs,), s."""
    late = np.zeros(inputs)
    for m in range(len(rows)):
        if rows[m, 0] == DELAY:
            late[rows[m, 1]] += p[rows[m, 5]]
    return late
