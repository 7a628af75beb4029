"""One implicit step: its five stages by a simplified Newton iteration, its error, and how long the next may be."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.articulated import articulate, momentum, solve
from straw.model.channel import STATES, inside_pressure
from straw.model.compiled import allocates_nothing, called, inlined
from straw.model.constants import Constants
from straw.model.drive import Table, pressure_in, seen
from straw.model.frusta import remember, tangent
from straw.model.kinematics import place
from straw.model.motion import spread
from straw.model.scheme import COEFFICIENTS, ERROR, GAMMA, GUESS, ORDER_BELOW, STAGES, TIMES
from straw.model.stages import Limits, Stages, State, Work, copy, recall, remembered_rate
from straw.model.straw import forces_left, volume_rate
from straw.model.terms.pressure import pressure_per_pa

Floats = NDArray[np.float64]

DONE, STEP_TOO_SMALL, NOT_FINITE, TOO_MANY_STEPS = 0, 1, 2, 3
SMALLEST_STEP_S = 1e-9
NEWTON_LIMIT = 8
#: Newton also stops at corrections of the size of rounding errors: at rest there are no others, and they do not shrink.
ROUNDING = 1e-6
#: Factor by which an earlier rate of convergence counts in the next iteration.
RATE_FADES = 0.3
#: An angle's tolerance is the length's over this: about what turns it into a displacement of the tip, with a margin.
LEVER_M = 0.2


@allocates_nothing
def size(x: Floats, tolerance_m: float) -> float:
    """Root mean square of a displacement in units of the tolerance; the first half is zeta, the second phi."""
    n, tolerance_rad = len(x) // 2, tolerance_m / LEVER_M
    zeta2 = phi2 = 0.0
    for i in range(n):
        zeta2 += x[i] ** 2
        phi2 += x[n + i] ** 2
    return math.sqrt((zeta2 / tolerance_m**2 + phi2 / tolerance_rad**2) / (2 * n))


@allocates_nothing
def _length(state: State, table: Table, sums: Floats, limits: Limits) -> float:
    """Length of the step to try: as the last error allows, to the end exactly and without a tiny last step."""
    time_s, step_s = state.clock[0], min(state.clock[1], limits.max_step_s)
    remaining = limits.end_s - time_s
    if step_s >= remaining * (1 - 1e-9):
        step_s = remaining
    elif step_s > remaining / 2:
        step_s = remaining / 2
    return seen(table, sums, time_s, step_s, limits.within_pa)


@inlined
def _newton_matrix(
    c: Constants, state: State, external_pa: float, hg: float, s: Stages, w: Work
) -> tuple[float, float]:
    """Factor Newton's matrix W at the step's start; the slope of the pressure there, and the flow that a pascal makes.

    Gyroscopic forces and the turning of loads are left out, as they are small beside M / hg^2. The pressure inside,
    which couples all rates, is left out as well and put in by how the straw yields to a pascal (`_displaced`).
    """
    spread(c, state.q, state.v, state.a, w.room.motion)
    w.room.motion.inside_pa[0], w.room.motion.time_s[0] = state.clock[2], c.start_s + state.clock[0]
    place(c, w.room.motion, w.start)
    tangent(c, w.room.motion, state.memory, s.memory[0], hg, w.blocks, w.K)
    articulate(c, w.start, w.blocks, hg, w.newton)
    pressure_per_pa(c, w.start, w.push)
    solve(c, w.newton, w.push, hg, w.yields)
    copy(state.inlet, w.inlet)
    _, slope = inside_pressure(w.channel, state.inlet, hg, external_pa, volume_rate(c, state.v), w.inlet)
    return slope, volume_rate(c, w.yields) / hg


@allocates_nothing
def _displaced(c: Constants, hg: float, slope: float, flow_per_pa: float, w: Work) -> None:
    """What the force left over displaces, into w.dq: W^-1 with the pressure's slope by the volume's rate added.

    That is of rank one (Sherman and Morrison); the slope differs between iterations, as the resistance of the inlet
    grows with the flow.
    """
    solve(c, w.newton, w.left, hg, w.dq)
    more_pa = slope * volume_rate(c, w.dq) / hg / (1 - slope * flow_per_pa)
    for j in range(len(w.dq)):
        w.dq[j] += more_pa * w.yields[j]


@allocates_nothing
def _known(state: State, h: float, i: int, remembers: bool, s: Stages, w: Work) -> None:
    """What stage i starts from, and a guess of where it ends."""
    hg = h * GAMMA
    for m in range(len(state.q)):
        known_q, known_v = state.q[m], state.v[m]
        for j in range(i):
            known_v += h * COEFFICIENTS[i, j] * s.a[j, m]
            known_q += h * COEFFICIENTS[i, j] * s.v[j, m]
        guess = GUESS[i, 0] * state.a[m]
        for j in range(i):
            guess += GUESS[i, j + 1] * s.a[j, m]
        s.a[i, m] = guess
        s.v[i, m] = known_v + hg * guess
        s.q[i, m] = known_q + hg * s.v[i, m]
    for m in range(STATES):
        s.known_inlet[i, m] = state.inlet[m]
        for j in range(i):
            s.known_inlet[i, m] += h * COEFFICIENTS[i, j] * w.inlet_rate[j, m]
    if remembers:
        recall(state.memory, w.memory_rate, h, i, s.known_memory[i])


@inlined
def _solve_stages(
    c: Constants,
    state: State,
    table: Table,
    h: float,
    limits: Limits,
    flow_per_pa: float,
    s: Stages,
    w: Work,
    counts: NDArray[np.int64],
) -> bool:
    """Find all stages; return whether Newton's method converged in each."""
    n, hg = len(state.q), h * GAMMA
    per_hg, per_hg2 = 1 / hg, 1 / hg**2
    rate = 1.0  # not carried over from step to step: with friction or trapped gas that lost 3 % of the energy
    for i in range(STAGES):
        _known(state, h, i, limits.remembers, s, w)
        q, v, a = s.q[i], s.v[i], s.a[i]
        time_s = state.clock[0] + TIMES[i] * h
        external_pa, w.room.motion.time_s[0] = pressure_in(table, time_s), c.start_s + time_s
        before, converged = np.inf, False
        for iteration in range(NEWTON_LIMIT):
            inside_pa, slope = inside_pressure(w.channel, s.known_inlet[i], hg, external_pa, volume_rate(c, v), w.inlet)
            forces_left(c, q, v, a, inside_pa, s.known_memory[i], s.memory[i], hg, w.room, w.left)
            _displaced(c, hg, slope, flow_per_pa, w)
            counts[3] += 1
            change = size(w.dq, limits.tolerance_m)
            if not np.isfinite(change):
                break
            for j in range(n):
                q[j] += w.dq[j]
                v[j] += w.dq[j] * per_hg
                a[j] += w.dq[j] * per_hg2
            if iteration > 0:
                rate = max(change / before, RATE_FADES * rate)
            # what is still missing after this iteration is about change * rate / (1 - rate)
            if change < ROUNDING or (rate < 0.9 and change * rate / (1 - rate) < limits.missing):
                converged = True
                break
            if rate > 2:
                break
            before = change
        if not converged:
            return False
        # what goes on to the next stage belongs to where this one ends, not to the iterate before
        s.inside_pa[i], _ = inside_pressure(w.channel, s.known_inlet[i], hg, external_pa, volume_rate(c, v), w.inlet)
        if limits.remembers:
            spread(c, q, v, a, w.room.motion)
            w.room.motion.inside_pa[0] = s.inside_pa[i]
            remember(c, w.room.motion, s.known_memory[i], s.memory[i], hg)
        for m in range(STATES):
            s.inlet[i, m] = w.inlet[m]
            w.inlet_rate[i, m] = (w.inlet[m] - s.known_inlet[i, m]) * per_hg
        if limits.remembers:
            remembered_rate(s.known_memory[i], s.memory[i], hg, w.memory_rate[i])
    return True


@allocates_nothing
def _error(c: Constants, h: float, limits: Limits, slope: float, flow_per_pa: float, s: Stages, w: Work) -> float:
    """Error of the step in units of the tolerance: the embedded formula's, times (1 - hg J)^-1.

    By itself that formula would include stiff modes that the method damps.
    """
    n, per_hg = len(w.left), 1 / (h * GAMMA)
    for m in range(n):
        w.error_q[m] = w.error_v[m] = 0.0
        for j in range(STAGES):
            w.error_q[m] += h * ERROR[j] * s.v[j, m]
            w.error_v[m] += h * ERROR[j] * s.a[j, m]
    momentum(c, w.start, w.newton, w.error_v, w.left)
    water = 0.0  # in the channel; where there is no gas it moves as the straw does
    if w.channel.gas_m3 == 0:
        water = w.channel.inertance * volume_rate(c, w.error_v)
    for i in range(n):
        w.left[i] = (w.left[i] + water * w.push[i]) * per_hg
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            z, p = (j - 2 + c.active) * c.cells + i, (j - 2 + 2 * c.active) * c.cells + i
            w.left[z] -= w.K[i, j, 0, 0] * w.error_q[z] + w.K[i, j, 0, 1] * w.error_q[p]
            w.left[p] -= w.K[i, j, 1, 0] * w.error_q[z] + w.K[i, j, 1, 1] * w.error_q[p]
    _displaced(c, h * GAMMA, slope, flow_per_pa, w)
    for i in range(n):
        w.error_q[i] += w.dq[i]
    return size(w.error_q, limits.tolerance_m)


@called
def take_step(
    c: Constants,
    state: State,
    table: Table,
    sums: Floats,
    limits: Limits,
    s: Stages,
    w: Work,
    counts: NDArray[np.int64],
) -> tuple[int, float]:
    """Try steps from ``state``, which stays, until one is accurate enough: DONE and its length, s, its stages in ``s``.

    Sets the length of the next in ``state.clock``. Otherwise the reason why there is none. ``counts`` grows by steps
    taken, steps rejected, Newton matrices and residuals; ``sums`` are the table's.
    """
    while True:
        if counts[0] + counts[1] >= limits.steps:
            return TOO_MANY_STEPS, 0.0
        h = _length(state, table, sums, limits)
        slope, flow_per_pa = _newton_matrix(c, state, pressure_in(table, state.clock[0]), h * GAMMA, s, w)
        counts[2] += 1
        if not _solve_stages(c, state, table, h, limits, flow_per_pa, s, w, counts):
            counts[1] += 1
            state.clock[1] = h / 4
            if h < SMALLEST_STEP_S:
                return STEP_TOO_SMALL, h
            continue
        error = _error(c, h, limits, slope, flow_per_pa, s, w)
        if not np.isfinite(error):
            return NOT_FINITE, h
        state.clock[1] = h * min(3.0, max(0.2, 0.85 * (error + 1e-12) ** (-1 / (ORDER_BELOW + 1))))
        if error <= 1:
            counts[0] += 1
            return DONE, h
        counts[1] += 1
        if h < SMALLEST_STEP_S:
            return STEP_TOO_SMALL, h
