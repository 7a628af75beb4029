"""Simulations of recordings with many values at once, for derivatives by differences: compiled once for all systems."""

from __future__ import annotations

from functools import cache

import numpy as np

from straw.replay.diagnose.systems.function.compiled import compiled, of_any_system
from straw.replay.diagnose.systems.function.kernel import Floats, Function, Indices, march
from straw.replay.diagnose.systems.function.shots import SYSTEM, Flags, rows_of


def _varied(
    slopes: Function,
    shown: Function,
    t: Floats,
    inputs: Floats,
    seen: Floats,
    counts: Flags,
    ends: Indices,
    sigma: Floats,
    starts: Floats,
    cs: Floats,
    rows: Indices,
    ps: Floats,
    lags: int,
    longest_s: float,
    ys: Floats,
    own: Floats,
    by: Floats,
) -> Floats:
    """Columns (M, k) of recordings one after the other: change of the channels from ``ys`` (channels, N) in sigmas per
    ``by`` (k,), with each row of ``cs`` (k, constants) and ``ps`` (k, parameters), without what the starts' columns
    ``own`` (M, free) can do."""
    states, none, runs, channels = starts.shape[1], np.zeros((0, 0)), len(ends) - 1, len(seen)
    out = np.zeros((channels * len(t) + runs, len(by)))
    for run in range(runs):
        a, b = ends[run], ends[run + 1]
        first, last = rows_of(run, a, b, channels)
        n, u, start = b - a, inputs[:, a:b].copy(), np.append(starts[run], np.zeros(lags))
        moved, basis = np.zeros((channels, n)), orthonormal(own[first:last])
        column = np.zeros(channels * n)
        for j in range(len(by)):
            if by[j] == 0.0:
                continue
            march(slopes, shown, t[a:b], u, start, cs[j], rows, ps[j], states, longest_s, moved, none, none)
            for i in range(channels):
                for k in range(n):
                    column[i * n + k] = 0.0
                    if counts[a + k] and not np.isnan(seen[i, a + k]):
                        column[i * n + k] = (moved[i, k] - ys[i, a + k]) / sigma[i] / by[j]
            for i in range(basis.shape[1]):
                column -= basis[:, i] * np.sum(basis[:, i] * column)
            out[first:last, j] = column
    return out


@compiled
def orthonormal(columns: Floats) -> Floats:
    """An orthonormal basis of columns (m, k), zero for those that depend on others."""
    out = np.zeros(columns.shape)
    for i in range(columns.shape[1]):
        one = columns[:, i].copy()
        size = np.sqrt(np.sum(one * one))
        for _ in range(2):
            for j in range(i):
                one -= out[:, j] * np.sum(out[:, j] * one)
        left = np.sqrt(np.sum(one * one))
        if left > 1e-10 * size:
            out[:, i] = one / left
    return out


@cache
def varied() -> Function:
    """`_varied`, compiled."""
    given = "table flags indices vector table table rows table count number table table vector"
    return of_any_system(_varied, f"{SYSTEM} {given}")
