"""Integrates the straw in second-order form: L-stable SDIRK of order 4(3) on the residual, never on M^-1.

Tableau: Hairer & Wanner, Solving Ordinary Differential Equations II, table IV.6.5 (gamma = 1/4, stiffly accurate).
Each stage solves residual(q, v, a, t) = 0 by a simplified Newton whose matrix M / (h gamma)^2 + C / (h gamma) + K has
one row a coordinate, half of what the first-order form needs. Working on the residual matters in the full form:
there M is singular (each cell's fluid is one rigid body with three velocities but has four coordinates).
Error control looks at q, which the camera sees; kHz modes below the tolerance are damped, not resolved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.compiled import compiled
from model.inertia import mass_matrix
from model.kinematics import chain_of, motion_of
from model.linear import factor, substitute
from model.parameters import Constants
from model.straw import residual

Floats = NDArray[np.float64]

GAMMA = 0.25
STAGES = 5
A = np.array(
    [
        [1 / 4, 0, 0, 0, 0],
        [1 / 2, 1 / 4, 0, 0, 0],
        [17 / 50, -1 / 25, 1 / 4, 0, 0],
        [371 / 1360, -137 / 2720, 15 / 544, 1 / 4, 0],
        [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
    ]
)
C = A.sum(axis=1)
ERROR = A[4] - np.array([59 / 48, -17 / 96, 225 / 32, -85 / 12, 0])

DONE, STEP_TOO_SMALL, NOT_FINITE, TOO_MANY_STEPS = 0, 1, 2, 3
SMALLEST_STEP_S = 1e-9
#: Steps a simulated second may take; the liveliest validation run takes 700.
MOST_STEPS_PER_S = 30_000
NEWTON_LIMIT = 8


class Table(NamedTuple):
    """External pressure on a uniform grid, linear between its points, constant beyond them."""

    start_s: float
    step_s: float
    pressure_pa: Floats


class State(NamedTuple):
    """Where an integration stands: arrays (coordinates,); clock = [time_s, next step_s]."""

    q: Floats
    v: Floats
    a: Floats
    clock: Floats


@compiled
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
def slope(
    c: Constants, q: Floats, v: Floats, a: Floats, external_pa: float, moved: Floats, j: int, step: float
) -> Floats:
    """Minus the derivative of the residual by ``moved[j]``, where ``moved`` is q or v itself; central difference."""
    held = moved[j]
    moved[j] = held + step
    up = residual(c, q, v, a, external_pa)
    moved[j] = held - step
    down = residual(c, q, v, a, external_pa)
    moved[j] = held
    return (down - up) / (2 * step)


@compiled
def linearise(c: Constants, q: Floats, v: Floats, a: Floats, external_pa: float) -> tuple[Floats, Floats, Floats]:
    """Mass, damping and stiffness matrices (M, C, K) of the residual about a motion.

    C and K by central differences: their error costs Newton iterations, never accuracy.
    """
    n = len(q)
    M = mass_matrix(c, chain_of(c, motion_of(c, q, v, a)))
    damping, stiffness = np.empty((n, n)), np.empty((n, n))
    q, v = q.copy(), v.copy()
    for j in range(n):
        zeta = j < n // 2
        stiffness[:, j] = slope(c, q, v, a, external_pa, q, j, 1e-8 if zeta else 1e-6)
        damping[:, j] = slope(c, q, v, a, external_pa, v, j, 1e-6 if zeta else 1e-4)
    return M, damping, stiffness


@compiled
def size(x: Floats, tolerance_m: float, tolerance_rad: float) -> float:
    """Root mean square of a displacement in units of the tolerance; the first half is zeta, the second phi."""
    n = len(x) // 2
    total = 0.0
    for i in range(n):
        total += (x[i] / tolerance_m) ** 2 + (x[n + i] / tolerance_rad) ** 2
    return math.sqrt(total / (2 * n))


@compiled
def integrate(
    c: Constants,
    state: State,
    table: Table,
    output_s: Floats,
    end_s: float,
    tolerance_m: float,
    max_step_s: float,
    out_q: Floats,
    out_v: Floats,
    counts: NDArray[np.int64],
) -> int:
    """Advance ``state`` in place to ``end_s``, filling out_q, out_v (outputs, coordinates) at ``output_s``.

    Outputs inside a step come from the cubic through q and v at both of its ends. ``counts`` grows by steps taken,
    steps rejected, linearisations and residuals. Returns DONE, or the reason for stopping early.
    """
    n = len(state.q)
    tolerance_rad = tolerance_m / c.r_i
    q, v, a = state.q, state.v, state.a
    stage_v, stage_a = np.empty((STAGES, n)), np.empty((STAGES, n))
    filled = 0
    while filled < len(output_s) and output_s[filled] <= state.clock[0]:
        out_q[filled], out_v[filled] = q, v
        filled += 1
    M = damping = stiffness = W = np.empty((n, n))
    order = np.empty(n, np.int64)
    fresh, known, factored_h = False, False, 0.0
    most_steps = 1000 + int(MOST_STEPS_PER_S * (end_s - state.clock[0]))
    tried = 0
    while state.clock[0] < end_s:
        tried += 1
        if tried > most_steps:
            return TOO_MANY_STEPS
        time_s = state.clock[0]
        # land exactly on the end, without a sliver of a last step
        h = min(state.clock[1], max_step_s)
        left = end_s - time_s
        if h >= left * (1 - 1e-9):
            h = left
        elif h > left / 2:
            h = left / 2
        if not known:
            M, damping, stiffness = linearise(c, q, v, a, pressure_in(table, time_s))
            counts[2] += 1
            counts[3] += 4 * n
            fresh, known, factored_h = True, True, 0.0
        hg = h * GAMMA
        if factored_h != h:
            W = M / hg**2 + damping / hg + stiffness
            order = factor(W)
            factored_h = h

        slowest = 0.0
        converged = True
        guess = a.copy()
        q_i, v_i = q, v
        for i in range(STAGES):
            v_known, q_known = v.copy(), q.copy()
            for j in range(i):
                v_known += h * A[i, j] * stage_a[j]
                q_known += h * A[i, j] * stage_v[j]
            a_i = guess.copy()
            v_i = v_known + hg * a_i
            q_i = q_known + hg * v_i
            external_pa = pressure_in(table, time_s + C[i] * h)
            before = np.inf
            converged = False
            for iteration in range(NEWTON_LIMIT):
                dq = substitute(W, order, residual(c, q_i, v_i, a_i, external_pa))
                counts[3] += 1
                change = size(dq, tolerance_m, tolerance_rad)
                if not np.isfinite(change):
                    break
                q_i = q_i + dq
                v_i = v_i + dq / hg
                a_i = a_i + dq / hg**2
                rate = change / before if iteration > 0 else 0.0
                slowest = max(slowest, rate)
                # what is still missing after this iteration is about change * rate / (1 - rate)
                if change < 1e-3 or (iteration > 0 and rate < 0.9 and change * rate / (1 - rate) < 1e-3):
                    converged = True
                    break
                if rate > 2:
                    break
                before = change
            if not converged:
                break
            stage_v[i], stage_a[i] = v_i, a_i
            guess = a_i

        if not converged:
            counts[1] += 1
            if fresh:
                state.clock[1] = h / 4
            else:
                known = False
            if h < SMALLEST_STEP_S:
                return STEP_TOO_SMALL
            continue

        error_q, error_v = np.zeros(n), np.zeros(n)
        for j in range(STAGES):
            error_q += h * ERROR[j] * stage_v[j]
            error_v += h * ERROR[j] * stage_a[j]
        # (1 - h gamma J)^-1 error: the embedded formula alone would see stiff modes that the method damps
        error_q += substitute(W, order, M @ error_v - hg * (stiffness @ error_q)) / hg
        error = size(error_q, tolerance_m, tolerance_rad)
        if not np.isfinite(error):
            return NOT_FINITE
        state.clock[1] = h * min(3.0, max(0.2, 0.85 * (error + 1e-12) ** -0.25))
        if error > 1:
            counts[1] += 1
            if h < SMALLEST_STEP_S:
                return STEP_TOO_SMALL
            continue
        counts[0] += 1
        new_s = end_s if h == left else time_s + h
        while filled < len(output_s) and output_s[filled] <= new_s:
            x = (output_s[filled] - time_s) / h
            for j in range(n):
                d = q_i[j] - q[j]
                out_q[filled, j] = q[j] + x * (
                    h * v[j] + x * (3 * d - h * (2 * v[j] + v_i[j]) + x * (h * (v[j] + v_i[j]) - 2 * d))
                )
                out_v[filled, j] = v[j] + x * (
                    2 * (3 * d / h - 2 * v[j] - v_i[j]) + 3 * x * (v[j] + v_i[j] - 2 * d / h)
                )
            filled += 1
        q[:], v[:], a[:] = q_i, v_i, stage_a[STAGES - 1]
        state.clock[0] = new_s
        fresh = False
        known = slowest < 0.2
    return DONE
