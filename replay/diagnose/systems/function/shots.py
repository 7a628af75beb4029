"""Simulations of recordings from their best starts, compiled once for all systems.

Unknown starts are constants of each recording alone; they are profiled out (variable projection: Golub and Pereyra
1973), by Gauss-Newton whose columns are recomputed only where a step with the old ones does not help.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.settings import ROBUST_SIGMAS
from straw.replay.diagnose.systems.function.compiled import compiled, of_any_system
from straw.replay.diagnose.systems.function.kernel import Floats, Function, Indices, march

Flags = NDArray[np.bool_]

#: Steps to a start, the step of its differences, the width of its prior in units of its scale, and the least gain of a
#: step as a share of the cost.
START_ROUNDS, START_STEP, START_SD, START_GAIN = 5, 1e-3, 30.0, 1e-3
#: Added to a unit diagonal: starts of which only a sum is seen, as closely as rounding tells, share the step.
ROUNDING = 1e-12


@compiled
def differences(ys: Floats, seen: Floats, counts: Flags, sigma: Floats, out: Floats) -> float:
    """Simulated minus recorded in sigmas into ``out`` (channels n,), zero where nothing counts, and the robust cost;
    infinite where the simulation diverged."""
    n, cost, c2 = len(counts), 0.0, ROBUST_SIGMAS**2
    for i in range(len(ys)):
        for k in range(n):
            r = 0.0
            if counts[k] and not np.isnan(seen[i, k]):
                r = (ys[i, k] - seen[i, k]) / sigma[i]
                cost += 2 * c2 * (np.sqrt(1 + r * r / c2) - 1)
            out[i * n + k] = r
    return cost if np.isfinite(cost) else np.inf


def _played(
    slopes: Function,
    shown: Function,
    t: Floats,
    inputs: Floats,
    start: Floats,
    c: Floats,
    rows: Indices,
    p: Floats,
    states: int,
    channels: int,
    longest_s: float,
) -> tuple[Floats, Floats, Floats]:
    """Channels (channels, n), states with lagging ones and their rates (states, n): see `march`."""
    ys, xs, rs = np.zeros((channels, len(t))), np.zeros((len(start), len(t))), np.zeros((len(start), len(t)))
    march(slopes, shown, t, inputs, start, c, rows, p, states, longest_s, ys, xs, rs)
    return ys, xs, rs


def _profiled(
    slopes: Function,
    shown: Function,
    t: Floats,
    inputs: Floats,
    seen: Floats,
    counts: Flags,
    ends: Indices,
    sigma: Floats,
    starts: Floats,
    scales: Floats,
    free: Indices,
    low: Floats,
    high: Floats,
    c: Floats,
    rows: Indices,
    p: Floats,
    lags: int,
    longest_s: float,
    o: Floats,
    columns: Floats,
    fresh: bool,
) -> tuple[Floats, Floats]:
    """Channels (channels, N) of recordings one after the other, ``ends`` (recordings + 1,), from their best starts, and
    these (recordings, states).

    Each begins at ``o`` (recordings, free), the distance from ``starts`` in ``scales`` (recordings, states), with
    columns (M, free) in sigmas unless these are to be ``fresh``; both are changed in place. M is as in `rows_of`.
    """
    states, shown_all, started = starts.shape[1], np.zeros(seen.shape), starts.copy()
    for run in range(len(ends) - 1):
        a, b = ends[run], ends[run + 1]
        first, last = rows_of(run, a, b, len(seen))
        ys = one_profiled(
            slopes, shown, t[a:b], inputs[:, a:b].copy(), seen[:, a:b].copy(), counts[a:b], sigma,
            np.append(starts[run], np.zeros(lags)), scales[run], free, low[run], high[run], c, rows, p, states,
            longest_s, o[run], columns[first:last], fresh,
        )  # fmt: skip
        shown_all[:, a:b] = ys
        for i in range(len(free)):
            k = free[i]
            started[run, k] = min(max(starts[run, k] + scales[run, k] * o[run, i], low[run, i]), high[run, i])
    return shown_all, started


@compiled
def rows_of(run: int, a: int, b: int, channels: int) -> tuple[int, int]:
    """A recording's rows in a campaign's vector (M,): its channels one after the other, and one row for events."""
    return channels * a + run, channels * b + run


@compiled
def one_profiled(
    slopes: Function,
    shown: Function,
    t: Floats,
    inputs: Floats,
    seen: Floats,
    counts: Flags,
    sigma: Floats,
    start: Floats,
    scale: Floats,
    free: Indices,
    low: Floats,
    high: Floats,
    c: Floats,
    rows: Indices,
    p: Floats,
    states: int,
    longest_s: float,
    o: Floats,
    columns: Floats,
    fresh: bool,
) -> Floats:
    """Channels (channels, n) of one recording from its best starts; ``o`` and ``columns`` as in `_profiled`."""
    m, many, none = seen.size, len(free), np.zeros((0, 0))
    r, r_new, ys, ys_new = np.zeros(m), np.zeros(m), np.zeros(seen.shape), np.zeros(seen.shape)
    at, at_new = start.copy(), start.copy()
    for i in range(many):
        at[free[i]] = min(max(start[free[i]] + scale[free[i]] * o[i], low[i]), high[i])
    march(slopes, shown, t, inputs, at, c, rows, p, states, longest_s, ys, none, none)
    cost = differences(ys, seen, counts, sigma, r)
    if many == 0 or not np.isfinite(ys).all():
        if fresh:
            columns[:] = 0.0
        return ys
    stale = not fresh
    for number in range(START_ROUNDS):
        if fresh:
            for i in range(many):
                at_new[:] = at
                step = START_STEP
                if start[free[i]] + scale[free[i]] * (o[i] + step) > high[i]:
                    step = -step
                at_new[free[i]] = max(start[free[i]] + scale[free[i]] * (o[i] + step), low[i])
                march(slopes, shown, t, inputs, at_new, c, rows, p, states, longest_s, ys_new, none, none)
                differences(ys_new, seen, counts, sigma, r_new)
                columns[:, i] = (r_new - r) / step
            fresh, stale = False, False
            if not np.isfinite(columns).all():
                columns[:] = 0.0
                return ys
        w = 1 / np.sqrt(1 + (r / ROBUST_SIGMAS) ** 2)
        curvature, pull = np.eye(many) / START_SD**2, o / START_SD**2
        for i in range(many):
            pull[i] += np.sum(columns[:, i] * w * r)
            for j in range(many):
                curvature[i, j] += np.sum(columns[:, i] * w * columns[:, j])
        size = np.sqrt(np.diag(curvature))
        scaled = curvature / np.outer(size, size) + ROUNDING * np.eye(many)
        step_o = -np.linalg.solve(scaled, pull / size) / size
        # the first step is taken even where it gains little, so that small differences between fits are right
        small = -np.sum(step_o * pull) < START_GAIN * cost
        if small and number > 0:
            break
        gain = 0.0
        for share in (1.0, 0.2):
            if small and share < 1.0:
                break
            at_new[:] = at
            for i in range(many):
                x = start[free[i]] + scale[free[i]] * (o[i] + share * step_o[i])
                at_new[free[i]] = min(max(x, low[i]), high[i])
            march(slopes, shown, t, inputs, at_new, c, rows, p, states, longest_s, ys_new, none, none)
            cost_new = differences(ys_new, seen, counts, sigma, r_new)
            if np.isfinite(ys_new).all() and cost_new < cost:
                gain, cost = cost - cost_new, cost_new
                for i in range(many):  # a start at a bound stays within reach of it
                    o[i] = (at_new[free[i]] - start[free[i]]) / scale[free[i]]
                at[:], ys[:], r[:] = at_new, ys_new, r_new
                break
        if gain < START_GAIN * cost:
            if small or not stale:
                break
            fresh = True
        else:
            stale = True
    for i in range(many):  # a start that is held at a bound does not follow the other values
        slope = np.sum(columns[:, i] * r)
        if (at[free[i]] <= low[i] and slope > 0) or (at[free[i]] >= high[i] and slope < 0):
            columns[:, i] = 0.0
    return ys


#: Arguments of every such function: slopes, shown, times, inputs.
SYSTEM = "function function vector table"


@cache
def played() -> Function:
    """`_played`, compiled."""
    return of_any_system(_played, f"{SYSTEM} vector vector rows vector count count number")


@cache
def profiled() -> Function:
    """`_profiled`, compiled."""
    starts = "table table indices table table"
    given = f"table flags indices vector {starts} vector rows vector count number table table flag"
    return of_any_system(_profiled, f"{SYSTEM} {given}")
