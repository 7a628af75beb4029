"""Integrates the straw in second-order form: an L-stable SDIRK method on the residual, never on M^-1.

Each stage solves forces_left(q, v, a) = 0 by a simplified Newton whose matrix M / (h gamma)^2 + C / (h gamma) + K has
one row a coordinate, half of what the first-order form needs. Working on the residual matters in the full form:
there M is singular (each cell's fluid is one rigid body with three velocities but has four coordinates).
States of first order (what the frusta remember, the way in) are solved for within a stage and need no rows.
Error control looks at q, which the camera sees; kHz modes below the tolerance are damped, not resolved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.channel import STATES, channel_at_rest, channel_of, inside_pressure
from model.compiled import allocates_nothing, compiled
from model.constants import Constants
from model.drive import Table, pressure_in, seen, summed
from model.frusta import MEMORIES, add_tangent
from model.inertia import mass_matrix
from model.kinematics import place, spread
from model.linear import factor, substitute
from model.scheme import COEFFICIENTS, ERROR, GAMMA, GUESS, ORDER_BELOW, STAGES, TIMES
from model.straw import forces_left, room_for, volume_rate
from model.terms.elasticity import softest
from model.terms.pressure import pressure_per_pa

Floats = NDArray[np.float64]

DONE, STEP_TOO_SMALL, NOT_FINITE, TOO_MANY_STEPS = 0, 1, 2, 3
SMALLEST_STEP_S = 1e-9
#: Steps allowed beside those each second may take, to begin with.
FIRST_STEPS = 1_000
NEWTON_LIMIT = 8
#: Newton stops when what is missing is this small in units of the tolerance; where states carry on what is left out, as
#: friction's and swinging water's do, when it is that small: more of it lets energy slip and steps multiply.
NEWTON_SHARE, CARRIED_SHARE = 1e-2, 3e-4
#: It stops as well at corrections as small as rounding makes them: at rest there are no others, and they do not shrink.
ROUNDING = 1e-6
#: How much of Newton's rate of convergence is still believed a stage later.
RATE_FADES = 0.3
#: The mean pressure of a step is seen to what moves a frustum by this share of the tolerance.
SEEN_SHARE = 1e-2
#: An angle's tolerance is the length's over this: about what turns it into a displacement of the tip, with a margin.
LEVER_M = 0.2


class State(NamedTuple):
    """Where an integration stands."""

    q: Floats  # (coordinates,)
    v: Floats
    a: Floats
    memory: Floats  # (cells, 2, MEMORIES, 2), see model.frusta
    way_in: Floats  # (STATES,), see model.channel
    clock: Floats  # time_s, next step_s, pressure inside_pa


@compiled
def at_rest(c: Constants, q: Floats, time_s: float, external_pa: float, first_step_s: float) -> State:
    """The state of a straw that rests at q."""
    return State(
        q.copy(),
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros((c.cells, 2, MEMORIES, 2)),
        channel_at_rest(c, external_pa),
        np.array([time_s, first_step_s, external_pa]),
    )


@allocates_nothing
def size(x: Floats, tolerance_m: float, tolerance_rad: float) -> float:
    """Root mean square of a displacement in units of the tolerance; the first half is zeta, the second phi."""
    n = len(x) // 2
    zeta2 = phi2 = 0.0
    for i in range(n):
        zeta2 += x[i] ** 2
        phi2 += x[n + i] ** 2
    return math.sqrt((zeta2 / tolerance_m**2 + phi2 / tolerance_rad**2) / (2 * n))


@compiled
def integrate(
    c: Constants,
    state: State,
    table: Table,
    output_s: Floats,
    end_s: float,
    tolerance_m: float,
    max_step_s: float,
    most_steps_per_s: float,
    out_q: Floats,
    out_v: Floats,
    out_pa: Floats,
    counts: NDArray[np.int64],
) -> int:
    """Advance ``state`` in place to ``end_s``, filling out_q, out_v (outputs, coordinates) at ``output_s``.

    Outputs inside a step come from the cubic through q and v at both of its ends; out_pa (outputs,), the pressure
    inside, from the line. ``counts`` grows by steps taken, steps rejected, Newton matrices and residuals.
    Returns DONE, or the reason for stopping early; more than ``most_steps_per_s``, tried, are one.
    """
    n = len(state.q)
    tolerance_rad = tolerance_m / LEVER_M
    q, v, a, clock = state.q, state.v, state.a, state.clock
    way, room = channel_of(c), room_for(c)
    stage_v, stage_a = np.zeros((STAGES, n)), np.zeros((STAGES, n))
    stage_memory = np.zeros((STAGES, *state.memory.shape))
    stage_way_in = np.zeros((STAGES, STATES))
    known_memory, memory = state.memory.copy(), state.memory.copy()
    known_way_in, way_in = state.way_in.copy(), state.way_in.copy()
    remembers = c.remembers
    carries = remembers or way.gas_m3 > 0 or way.inertance > 0 or way.lag_s > 0
    missing = CARRIED_SHARE if carries else NEWTON_SHARE
    sums, within_pa = summed(table), SEEN_SHARE * tolerance_m * softest(c) / c.C3
    q_i, v_i, a_i = q.copy(), v.copy(), a.copy()
    left, dq, push, error_q, error_v = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    yields = np.empty(n)
    M, W, K = np.empty((n, n)), np.empty((n, n)).T, np.zeros((c.cells, 2, 2, 2))  # .T: see model.linear
    order = np.empty(n, np.int64)
    filled = 0
    while filled < len(output_s) and output_s[filled] <= clock[0]:
        out_q[filled], out_v[filled], out_pa[filled] = q, v, clock[2]
        filled += 1
    tried, most = 0, FIRST_STEPS + int(most_steps_per_s * (end_s - clock[0]))
    while clock[0] < end_s:
        tried += 1
        if tried > most:
            return TOO_MANY_STEPS
        time_s = clock[0]
        # land exactly on the end, without a sliver of a last step
        h = min(clock[1], max_step_s)
        remaining = end_s - time_s
        if h >= remaining * (1 - 1e-9):
            h = remaining
        elif h > remaining / 2:
            h = remaining / 2
        h = seen(table, sums, time_s, h, within_pa)
        hg = h * GAMMA
        per_hg, per_hg2 = 1 / hg, 1 / hg**2
        rate = 1.0  # not believed from step to step: with friction or trapped gas that let 3 % of the energy slip

        # Newton's matrix; gyroscopic forces and the turning of loads are left out, as they are small beside M / hg^2.
        # The way in resists more the more flows, which changes within a step. That is one number, so every iteration
        # puts it right by how the straw yields to a pascal inside (Sherman and Morrison).
        spread(c, q, v, a, room.motion)
        place(c, room.motion, room.chain)
        mass_matrix(c, room.chain, M)
        pressure_per_pa(c, room.chain, push)
        way_in[:] = state.way_in
        _, resists = inside_pressure(way, state.way_in, hg, pressure_in(table, time_s), volume_rate(c, v), way_in)
        slope = resists
        if way.gas_m3 == 0:  # then the straw moves all of the fluid in the channel, whose inertia is its own
            slope += way.inertance / hg
            for i in range(n):
                for j in range(n // 2):
                    M[i, j] += push[i] * way.inertance * c.S
        for j in range(n):
            for i in range(n):
                W[i, j] = M[i, j] * per_hg2
        for j in range(n // 2):
            for i in range(n):
                W[i, j] -= push[i] * slope * c.S * per_hg
        add_tangent(c, room.motion, state.memory, memory, hg, W, K)
        factor(W, order)
        substitute(W, order, push, yields)
        flow_per_pa = per_hg * volume_rate(c, yields)
        counts[2] += 1

        converged = True
        inside_pa = 0.0
        for i in range(STAGES):
            for m in range(n):
                known_q, known_v = q[m], v[m]
                for j in range(i):
                    known_v += h * COEFFICIENTS[i, j] * stage_a[j, m]
                    known_q += h * COEFFICIENTS[i, j] * stage_v[j, m]
                guess = GUESS[i, 0] * a[m]
                for j in range(i):
                    guess += GUESS[i, j + 1] * stage_a[j, m]
                a_i[m] = guess
                v_i[m] = known_v + hg * guess
                q_i[m] = known_q + hg * v_i[m]
            for m in range(STATES):
                known_way_in[m] = state.way_in[m]
                for j in range(i):
                    known_way_in[m] += h * COEFFICIENTS[i, j] * stage_way_in[j, m]
            if remembers:
                known_memory[:] = state.memory
                for j in range(i):
                    known_memory += h * COEFFICIENTS[i, j] * stage_memory[j]
            external_pa = pressure_in(table, time_s + TIMES[i] * h)
            before = np.inf
            converged = False
            for iteration in range(NEWTON_LIMIT):
                inside_pa, slope = inside_pressure(way, known_way_in, hg, external_pa, volume_rate(c, v_i), way_in)
                forces_left(c, q_i, v_i, a_i, inside_pa, known_memory, memory, hg, room, left)
                substitute(W, order, left, dq)
                steeper = slope - resists
                more_pa = steeper * per_hg * volume_rate(c, dq) / (1 - steeper * flow_per_pa)
                for j in range(n):
                    dq[j] += more_pa * yields[j]
                counts[3] += 1
                change = size(dq, tolerance_m, tolerance_rad)
                if not np.isfinite(change):
                    break
                for j in range(n):
                    q_i[j] += dq[j]
                    v_i[j] += dq[j] * per_hg
                    a_i[j] += dq[j] * per_hg2
                if iteration > 0:
                    rate = max(change / before, RATE_FADES * rate)
                # what is still missing after this iteration is about change * rate / (1 - rate)
                if change < ROUNDING or (rate < 0.9 and change * rate / (1 - rate) < missing):
                    converged = True
                    break
                if rate > 2:
                    break
                before = change
            if not converged:
                break
            stage_v[i], stage_a[i] = v_i, a_i
            for m in range(STATES):
                stage_way_in[i, m] = (way_in[m] - known_way_in[m]) * per_hg
            if remembers:
                stage_memory[i] = (memory - known_memory) / hg

        if not converged:
            counts[1] += 1
            clock[1] = h / 4
            if h < SMALLEST_STEP_S:
                return STEP_TOO_SMALL
            continue

        for m in range(n):
            error_q[m] = error_v[m] = 0.0
            for j in range(STAGES):
                error_q[m] += h * ERROR[j] * stage_v[j, m]
                error_v[m] += h * ERROR[j] * stage_a[j, m]
        # (1 - hg J)^-1 error: the embedded formula alone would see stiff modes that the method damps
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += M[i, j] * error_v[j]
            left[i] = total * per_hg
        for i in range(c.cells):
            for j in range(2 - c.active, 2):
                z, p = (j - 2 + c.active) * c.cells + i, (j - 2 + 2 * c.active) * c.cells + i
                left[z] -= K[i, j, 0, 0] * error_q[z] + K[i, j, 0, 1] * error_q[p]
                left[p] -= K[i, j, 1, 0] * error_q[z] + K[i, j, 1, 1] * error_q[p]
        substitute(W, order, left, dq)
        error_q += dq
        error = size(error_q, tolerance_m, tolerance_rad)
        if not np.isfinite(error):
            return NOT_FINITE
        clock[1] = h * min(3.0, max(0.2, 0.85 * (error + 1e-12) ** (-1 / (ORDER_BELOW + 1))))
        if error > 1:
            counts[1] += 1
            if h < SMALLEST_STEP_S:
                return STEP_TOO_SMALL
            continue
        counts[0] += 1
        new_s = end_s if h == remaining else time_s + h
        while filled < len(output_s) and output_s[filled] <= new_s:
            x = (output_s[filled] - time_s) / h
            out_pa[filled] = clock[2] + x * (inside_pa - clock[2])
            for j in range(n):
                d = q_i[j] - q[j]
                out_q[filled, j] = q[j] + x * (
                    h * v[j] + x * (3 * d - h * (2 * v[j] + v_i[j]) + x * (h * (v[j] + v_i[j]) - 2 * d))
                )
                out_v[filled, j] = v[j] + x * (
                    2 * (3 * d / h - 2 * v[j] - v_i[j]) + 3 * x * (v[j] + v_i[j] - 2 * d / h)
                )
            filled += 1
        q[:], v[:], a[:] = q_i, v_i, a_i
        state.memory[:], state.way_in[:] = memory, way_in
        clock[0], clock[2] = new_s, inside_pa
    return DONE
