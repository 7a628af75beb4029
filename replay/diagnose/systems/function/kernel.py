"""Integrates a user's slopes with added laws: the classical Runge-Kutta rule, compiled together with the slopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.compiled import compiled
from straw.replay.diagnose.systems.function.shapes import value

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Places and states of a law. Columns of a law's row of integers: place, its number, state, its number, shape, first
#: parameter, number of parameters, number of its lagging state or -1.
RATE, FACTOR, CHANNEL, CLOCK, DELAY, STRENGTH, INPUT, SHIFT = range(8)
OF_STATE, OF_RATE, OF_INPUT, OF_TIME, OF_NOTHING, OF_SHOWN = range(6)


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
def state_of(kind: int, which: int, t: float, x: Floats, rates: Floats, u: Floats, y: Floats) -> float:
    """A state's value."""
    if kind == OF_STATE:
        return float(x[which])
    if kind == OF_RATE:
        return float(rates[which])
    if kind == OF_INPUT:
        return float(u[which])
    if kind == OF_TIME:
        return t
    if kind == OF_SHOWN:
        return float(y[which])
    return 1.0


@compiled
def forces(
    rows: Indices, p: Floats, t: float, x: Floats, rates: Floats, u: Floats, y: Floats, states: int, out: Floats
) -> None:
    """Values of all laws (laws,), strengths that depend on something multiplied in."""
    for m in range(len(rows)):
        row = rows[m]
        s = float(x[states + row[7]]) if row[7] >= 0 else state_of(row[2], row[3], t, x, rates, u, y)
        out[m] = value(row[4], p[row[5] : row[5] + row[6]], s)
    for m in range(len(rows)):
        if rows[m, 0] == STRENGTH:
            out[rows[m, 1]] *= 1.0 + out[m]


def built(slopes: Callable[..., Any], shown: Callable[..., Any]) -> Callable[..., Any]:
    """The integrator of a system: ``slopes(t, x, u, c, out)`` and ``shown(t, x, u, c, out)`` write into their last
    argument.

    The integrator takes times (n,), inputs (rows, n; the user's first, then their rates), starts, constants, laws as
    rows and parameters, the longest step, and gives shown (channels, n), states with lagging ones, their rates, and the
    inputs as felt.
    """

    @compiled
    def rates_at(
        out: Floats,
        t: float,
        x: Floats,
        u: Floats,
        c: Floats,
        rows: Indices,
        p: Floats,
        states: int,
        needs_rates: bool,
        work: Floats,
        c_work: Floats,
        u_work: Floats,
        y: Floats,
    ) -> None:
        plain = out[:states]
        if needs_rates and states > 0:
            slopes(t, x, u, c, plain)
        if len(rows) == 0:
            if states > 0:
                slopes(t, x, u, c, plain)
            return
        forces(rows, p, t, x, plain, u, y, states, work)
        c_work[:] = c
        u_work[:] = u
        for m in range(len(rows)):
            if rows[m, 0] == FACTOR:
                c_work[rows[m, 1]] *= 1.0 + work[m]
            elif rows[m, 0] == SHIFT:
                c_work[rows[m, 1]] += work[m]
            elif rows[m, 0] == INPUT:
                u_work[rows[m, 1]] += work[m]
        for m in range(len(rows)):
            if rows[m, 7] >= 0:  # the lag's time is the parameter before its shape's
                s = state_of(rows[m, 2], rows[m, 3], t, x, plain, u, y)
                out[states + rows[m, 7]] = (s - x[states + rows[m, 7]]) / p[rows[m, 5] - 1]
        if states > 0:
            slopes(t, x, u_work, c_work, plain)
        for m in range(len(rows)):
            if rows[m, 0] == RATE:
                out[rows[m, 1]] += work[m]

    @compiled
    def march(
        t: Floats,
        inputs: Floats,
        start: Floats,
        c: Floats,
        rows: Indices,
        p: Floats,
        late: Floats,
        states: int,
        channels: int,
        longest_s: float,
    ) -> tuple[Floats, Floats, Floats]:
        n, size = len(t), len(start)
        ys, xs, rs = np.zeros((channels, n)), np.zeros((size, n)), np.zeros((size, n))
        us = np.zeros(len(inputs))
        work, c_work, u_work = np.zeros(len(rows)), c.copy(), np.zeros(len(inputs))
        y = np.zeros(channels)
        k1, k2, k3, k4 = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
        x = start.copy()
        needs_rates, lagging = False, False
        for m in range(len(rows)):
            needs_rates |= rows[m, 2] == OF_RATE
            if rows[m, 7] >= 0:  # a lagging state starts at the value it follows
                lagging = True
        if lagging:
            inputs_at(0, 0.0, late, t, inputs, us)
            for m in range(len(rows)):
                if rows[m, 7] >= 0:
                    x[states + rows[m, 7]] = state_of(rows[m, 2], rows[m, 3], t[0], x, k1, us, y)
        args = (c, rows, p, states, needs_rates, work, c_work, u_work, y)
        for k in range(n):
            inputs_at(min(k, n - 2), 0.0 if k < n - 1 else 1.0, late, t, inputs, us)
            k1[:] = 0.0
            rates_at(k1, t[k], x, us, *args)
            xs[:, k], rs[:, k] = x, k1
            # constants and inputs as modified by laws enter the channels, too
            c_work[:] = c
            u_work[:] = us
            if len(rows) > 0:
                forces(rows, p, t[k], x, k1, us, y, states, work)
                for m in range(len(rows)):
                    if rows[m, 0] == FACTOR:
                        c_work[rows[m, 1]] *= 1.0 + work[m]
                    elif rows[m, 0] == SHIFT:
                        c_work[rows[m, 1]] += work[m]
                    elif rows[m, 0] == INPUT:
                        u_work[rows[m, 1]] += work[m]
            shown(t[k], x, u_work, c_work, y)
            for m in range(len(rows)):
                if rows[m, 0] == CHANNEL:
                    s = (
                        x[states + rows[m, 7]]
                        if rows[m, 7] >= 0
                        else state_of(rows[m, 2], rows[m, 3], t[k], x, k1, us, y)
                    )
                    f = value(rows[m, 4], p[rows[m, 5] : rows[m, 5] + rows[m, 6]], s)
                    for j in range(len(rows)):
                        if rows[j, 0] == STRENGTH and rows[j, 1] == m:
                            f *= 1.0 + work[j]
                    ys[rows[m, 1], k] += f
            ys[:, k] += y
            if k == n - 1 or size == 0:
                continue
            whole = t[k + 1] - t[k]
            parts = max(1, int(np.ceil(whole / longest_s)))
            h = whole / parts
            for i in range(parts):
                at = t[k] + i * h
                if i > 0:
                    inputs_at(k, i / parts, late, t, inputs, us)
                    rates_at(k1, at, x, us, *args)
                inputs_at(k, (i + 0.5) / parts, late, t, inputs, us)
                rates_at(k2, at + h / 2, x + h / 2 * k1, us, *args)
                rates_at(k3, at + h / 2, x + h / 2 * k2, us, *args)
                inputs_at(k, (i + 1.0) / parts, late, t, inputs, us)
                rates_at(k4, at + h, x + h * k3, us, *args)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            for i in range(size):
                if not abs(x[i]) < 1e12:
                    ys[:, k + 1 :] = np.nan
                    return ys, xs, rs
        return ys, xs, rs

    return march
