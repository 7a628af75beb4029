"""Integrates a user's slopes with added laws: the classical Runge-Kutta rule, compiled once for all systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.clocks import delays, inputs_at, warped
from straw.replay.diagnose.systems.function.codes import (
    ALONG,
    CHANNEL,
    CLOCK,
    DELAY,
    FACTOR,
    INPUT,
    OF_RATE,
    OF_SHOWN,
    RATE,
    SHIFT,
    STRENGTH,
)
from straw.replay.diagnose.systems.function.compiled import compiled
from straw.replay.diagnose.systems.function.law_values import ahead_of, law_at, speed_of, state_of, within
from straw.replay.diagnose.systems.function.shapes import PLAY, YIELDS

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Function = Callable[..., Any]

#: A state beyond this has diverged.
DIVERGED = 1e12


@compiled
def changed(
    rows: Indices,
    p: Floats,
    t: float,
    x: Floats,
    rates: Floats,
    u: Floats,
    c: Floats,
    y: Floats,
    states: int,
    forces: Floats,
    u_out: Floats,
    c_out: Floats,
) -> None:
    """Values of all laws (laws,), strengths that depend on something multiplied in, and inputs and constants as these
    change them."""
    for i in range(len(c)):
        c_out[i] = c[i]
    for i in range(len(u)):
        u_out[i] = u[i]
    for m in range(len(rows)):
        forces[m] = 0.0
        if rows[m, 0] != CLOCK and rows[m, 0] != DELAY:
            forces[m] = law_at(m, rows, p, t, x, rates, u, y, states)
    for m in range(len(rows)):
        if rows[m, 0] == STRENGTH:
            forces[rows[m, 1]] *= 1.0 + forces[m]
    for m in range(len(rows)):
        if rows[m, 0] == FACTOR:
            c_out[rows[m, 1]] *= 1.0 + forces[m]
        elif rows[m, 0] == SHIFT:
            c_out[rows[m, 1]] += forces[m]
        elif rows[m, 0] == INPUT:
            u_out[rows[m, 1]] += forces[m]


@compiled
def rates_at(
    slopes: Function,
    out: Floats,
    t: float,
    x: Floats,
    u: Floats,
    c: Floats,
    rows: Indices,
    p: Floats,
    states: int,
    needs_rates: bool,
    forces: Floats,
    u_work: Floats,
    c_work: Floats,
    y: Floats,
) -> None:
    """Rates of the states and of lagging ones, into ``out``."""
    if len(rows) == 0:
        if states > 0:
            slopes(t, x, u, c, out)
        return
    if needs_rates and states > 0:
        slopes(t, x, u, c, out)
    changed(rows, p, t, x, out, u, c, y, states, forces, u_work, c_work)
    for m in range(len(rows)):
        if rows[m, 7] >= 0:  # the lag's time is the parameter before its shape's
            s = state_of(rows[m, 2], rows[m, 3], t, x, out, u, y)
            z = x[states + rows[m, 7]]
            plays = rows[m, 4] == PLAY or rows[m, 4] == YIELDS
            out[states + rows[m, 7]] = (s - z) / p[rows[m, 5] - 1] if not plays else 0.0
    if states > 0:
        slopes(t, x, u_work, c_work, out)
    for m in range(len(rows)):
        if rows[m, 0] == RATE:
            out[rows[m, 1]] += forces[m]
        elif rows[m, 0] == ALONG:
            speed = speed_of(rows[m, 1], x)
            for i in range(states):
                if (rows[m, 1] >> i) & 1 and speed > 0:
                    out[i] += forces[m] * x[i] / speed


@compiled
def march(
    slopes: Function,
    shown: Function,
    t: Floats,
    inputs: Floats,
    start: Floats,
    c: Floats,
    rows: Indices,
    p: Floats,
    states: int,
    longest_s: float,
    ys: Floats,
    xs: Floats,
    rs: Floats,
) -> None:
    """Channels into ``ys`` (channels, n), states with lagging ones and their rates into ``xs`` and ``rs`` (states, n),
    unless these have no columns; NaN from where it diverges.

    ``slopes(t, x, u, c, out)`` and ``shown`` write into their last argument. ``inputs`` (rows, n) are the user's, then
    their rates; ``c`` constants; ``rows`` and ``p`` laws and their parameters; ``start`` (states and lagging ones,).
    """
    n, size, keeps = len(t), len(start), xs.shape[1] > 0
    ys[:] = 0.0
    forces, c_work, us, u_work = np.zeros(len(rows)), c.copy(), np.zeros(len(inputs)), np.zeros(len(inputs))
    y, x, x_work = np.zeros(len(ys)), start.copy(), np.zeros(size)
    k1, k2, k3, k4 = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    late = delays(rows, p, len(inputs))
    needs_rates = False
    for m in range(len(rows)):
        needs_rates |= rows[m, 2] == OF_RATE
        if rows[m, 7] >= 0:  # a lagging state starts at the value it follows
            inputs_at(0, 0.0, late, t, inputs, us)
            s = state_of(rows[m, 2], rows[m, 3], t[0], x, k1, us, y)
            if rows[m, 4] == YIELDS:
                x[states + rows[m, 7] + 1] = s
            else:
                x[states + rows[m, 7]] = s
    for k in range(n):
        inputs_at(min(k, n - 2), 0.0 if k < n - 1 else 1.0, late, t, inputs, us)
        if size > 0:
            rates_at(slopes, k1, t[k], x, us, c, rows, p, states, needs_rates, forces, u_work, c_work, y)
        if keeps:
            for i in range(size):
                xs[i, k], rs[i, k] = x[i], k1[i]
        # constants and inputs as changed by laws enter the channels, too
        if len(rows) == 0:
            shown(t[k], x, us, c, y)
        else:
            if needs_rates or size == 0:
                changed(rows, p, t[k], x, k1, us, c, y, states, forces, u_work, c_work)
            shown(t[k], x, u_work, c_work, y)
            for m in range(len(rows)):
                if rows[m, 0] == CHANNEL:
                    f = forces[m]
                    if rows[m, 2] == OF_SHOWN and rows[m, 7] < 0:  # over what is shown at this sample
                        f = law_at(m, rows, p, t[k], x, k1, us, y, states)
                        for j in range(len(rows)):
                            if rows[j, 0] == STRENGTH and rows[j, 1] == m:
                                f *= 1.0 + forces[j]
                    ys[rows[m, 1], k] += f
        for i in range(len(y)):
            ys[i, k] += y[i]
        if k == n - 1 or size == 0:
            continue
        whole = t[k + 1] - t[k]
        parts = max(1, int(np.ceil(whole / longest_s)))
        h = whole / parts
        for part in range(parts):
            at = t[k] + part * h
            if part > 0:
                inputs_at(k, part / parts, late, t, inputs, us)
                rates_at(slopes, k1, at, x, us, c, rows, p, states, needs_rates, forces, u_work, c_work, y)
            inputs_at(k, (part + 0.5) / parts, late, t, inputs, us)
            for i in range(size):
                x_work[i] = x[i] + h / 2 * k1[i]
            rates_at(slopes, k2, at + h / 2, x_work, us, c, rows, p, states, needs_rates, forces, u_work, c_work, y)
            for i in range(size):
                x_work[i] = x[i] + h / 2 * k2[i]
            rates_at(slopes, k3, at + h / 2, x_work, us, c, rows, p, states, needs_rates, forces, u_work, c_work, y)
            inputs_at(k, (part + 1.0) / parts, late, t, inputs, us)
            for i in range(size):
                x_work[i] = x[i] + h * k3[i]
            rates_at(slopes, k4, at + h, x_work, us, c, rows, p, states, needs_rates, forces, u_work, c_work, y)
            for i in range(size):
                x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])
            for m in range(len(rows)):
                if rows[m, 4] == PLAY or rows[m, 4] == YIELDS:  # constant within a step, where `law_at` moves it
                    s, i = state_of(rows[m, 2], rows[m, 3], at + h, x, k4, us, y), states + rows[m, 7]
                    if rows[m, 4] == PLAY:
                        x[i] = within(x[i], s, p[rows[m, 5] - 1])
                    else:
                        x[i], x[i + 1] = ahead_of(x[i], s - x[i + 1], p[rows[m, 5] - 1]), s
        for i in range(size):
            if not abs(x[i]) < DIVERGED:
                ys[:, k + 1 :] = np.nan
                return
    warped(rows, p, t, ys)
