"""Derivatives of a run along many directions at once: tangents of the integrator's own steps at fixed step lengths.

After an accepted step every stage is linearised exactly at its solution and solved for all columns together; columns
lie side by side in memory. Cost for nine cells: one linearisation per stage, then some 1400 multiplications per stage
and column.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Bench, Columns, add, bench_for
from straw.model.channel import STATES, Channel
from straw.model.compiled import allocates_nothing, called, compiled, inlined
from straw.model.constants import Constants
from straw.model.drive import Table, pressure_in
from straw.model.elimination import eliminate
from straw.model.frusta import MEMORIES, MEMORY_PLACES
from straw.model.frusta_slopes import frusta_slopes
from straw.model.given import Given
from straw.model.given_loads import add_given, add_per_pascal
from straw.model.inlet_columns import advance_inlet
from straw.model.kinematics import place
from straw.model.linearised import linearise
from straw.model.motion import spread
from straw.model.pushing import add_pushed, body_slopes
from straw.model.scheme import COEFFICIENTS, GAMMA, STAGES, TIMES
from straw.model.stages import Stages, State, copy, stages_for
from straw.model.sweeps import Rows, rows_of, solve
from straw.model.vectors import plus

Floats = NDArray[np.float64]

#: A stage's length at which damping and inertia are negligible beside stiffness, s.
REST_S = 1e9


@allocates_nothing
def _linearised(c: Constants, given: Given, s: Stages, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """Linearise the straw at a stage's solution, and clear the block."""
    block = b.sweeps.block
    spread(c, s.q[stage], s.v[stage], s.a[stage], b.motion)
    b.motion.inside_pa[0] = s.inside_pa[stage]
    if given.in_world or len(given.body):
        place(c, b.motion, b.chain)
        body_slopes(c, b)
    frusta_slopes(c, b.motion, s.known_memory[stage], b.remembering[3:5], hg, b.slopes, b.memory_by)
    linearise(c, b.motion, b.slopes, b.law, b.pushed, b.links)
    eliminate(c, b.links, b.law, b.pushed, s.inside_pa[stage], hg, b.eliminating, b.sweeps)
    for i in range(c.cells):
        empty = b.sweeps.flat[i, : rows.q * block.shape[2]]
        for x in range(np.uint64(len(empty))):
            empty[x] = 0.0
        if given.odd_moves:
            odd = block[i, rows.rigid]
            for p in range(given.odd.shape[1]):
                odd[p] = given.odd[i, p]
    at_base = b.sweeps.flat[0, rows.joint * block.shape[2] :]
    for x in range(np.uint64(len(at_base))):
        at_base[x] = 0.0


@inlined
def _recalled(c: Constants, b: Bench, rows: Rows) -> None:
    """The columns of the memories without motion, and their force."""
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            for at in range(MEMORIES):
                if not c.acts[MEMORY_PLACES[at]]:
                    continue
                for y in range(2):
                    now, by, known = b.now_memory[i, j, at, y], b.memory_by[i, j, at, y], b.known_memory[i, j, at]
                    for p in range(len(now)):
                        now[p] = by[4] * known[0, p] + by[5] * known[1, p]
                    add(-1.0, now, b.sweeps.block[i, rows.force + j - 2 + c.active + y * c.active])


@called
def _answered(c: Constants, given: Given, s: Stages, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """Accelerations of all columns at a stage's solution and pressure, and behind them those per pascal inside."""
    block, n, P = b.sweeps.block, c.cells, given.scalars.shape[1]
    _linearised(c, given, s, stage, hg, b, rows)
    if given.remembers:
        _recalled(c, b, rows)
    add_given(c, given, s, stage, hg, b, rows)
    add_pushed(c, given, b, rows)
    for i in range(n):
        for x in range(c.active):
            block[i, rows.force + x, P] = c.C3
    if not c.plain:
        add_per_pascal(c, s, stage, hg, b, rows, P)
    end = math.pi * c.r_i**2
    block[n - 1, rows.beyond, P] = end * b.links.axis[n, 0]
    block[n - 1, rows.beyond + 1, P] = end * b.links.axis[n, 1]
    solve(c, b.links, b.sweeps, b.found)


@inlined
def _remembered(c: Constants, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """The columns of the memories at the stage's end, and their rates."""
    W = b.sweeps.block.shape[2]
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            z, f = j - 2 + c.active, j - 2 + 2 * c.active
            for at in range(MEMORIES):
                if not c.acts[MEMORY_PLACES[at]]:
                    continue
                for y in range(2):
                    now, by = b.now_memory[i, j, at, y], b.memory_by[i, j, at, y]
                    rate, known = b.memory[stage, i, j, at, y], b.known_memory[i, j, at, y]
                    q_zeta, q_phi = b.sweeps.block[i, rows.q + z], b.sweeps.block[i, rows.q + f]
                    v_zeta, v_phi = b.qv[stage, i, z * W :], b.qv[stage, i, f * W :]
                    for p in range(len(now)):
                        now[p] += by[0] * q_zeta[p] + by[1] * q_phi[p] + by[2] * v_zeta[p] + by[3] * v_phi[p]
                        now[p] += by[6] * b.inside_pa[p]
                        rate[p] = (now[p] - known[p]) / hg


@allocates_nothing
def _known(c: Constants, state: State, i: int, h: float, d: Columns, given: Given, b: Bench, rows: Rows) -> None:
    """Initial columns of stage i, into the block, and displacements that follow from the known rates."""
    P, W, hg = np.uint64(len(d.inside_pa)), b.sweeps.block.shape[2], h * GAMMA
    many = d.qv.shape[1]
    half = many // 2
    for cell in range(d.qv.shape[0]):
        qv, start = b.sweeps.flat[cell, rows.q * W : rows.q * W + many], d.qv[cell]
        plus(start, h * COEFFICIENTS[i, 0] if i > 0 else 0.0, b.qv[0, cell], qv)
        for j in range(1, i):
            plus(qv, h * COEFFICIENTS[i, j], b.qv[j, cell], qv)
        plus(qv[:half], hg, qv[half:], qv[:half])
    for x in range(STATES):
        for p in range(P):
            b.known_inlet[x, p] = d.inlet[x, p]
        for j in range(i):
            for p in range(P):
                b.known_inlet[x, p] += h * COEFFICIENTS[i, j] * b.inlet[j, x, p]
    if given.remembers:
        for cell in range(d.qv.shape[0]):
            for f in range(2):
                for at in range(MEMORIES):
                    if not c.acts[MEMORY_PLACES[at]]:
                        continue
                    for y in range(2):
                        known = b.known_memory[cell, f, at, y]
                        for p in range(P):
                            known[p] = d.memory[cell, f, at, y, p]
                        for j in range(i):
                            for p in range(P):
                                known[p] += h * COEFFICIENTS[i, j] * b.memory[j, cell, f, at, y, p]


@allocates_nothing
def _moved_on(c: Constants, stage: int, hg: float, b: Bench, rows: Rows, P: int) -> None:
    """Rates of the columns in a stage and their displacements at its end, by the accelerations at its pressure and
    what the pressure inside adds."""
    W, k = b.sweeps.block.shape[2], 2 * c.active
    b.inside_pa[P] = -1.0  # cancels the response per pascal in its own column
    for i in range(c.cells):
        q, v = b.sweeps.flat[i, rows.q * W : rows.v * W], b.sweeps.flat[i, rows.v * W : rows.rigid * W]
        q_rate, v_rate = b.qv[stage, i, : k * W], b.qv[stage, i, k * W :]
        for x in range(k):
            plus(b.found[i, x], b.found[i, x, P], b.inside_pa, v_rate[x * W : (x + 1) * W])
        plus(v, hg, v_rate, q_rate)
        plus(q, hg * hg, v_rate, q)


@inlined
def _solve_stage(
    c: Constants,
    given: Given,
    table: Table,
    w: Channel,
    state: State,
    h: float,
    s: Stages,
    stage: int,
    d: Columns,
    b: Bench,
) -> None:
    """All columns of one stage: rates of q and v into the bench, and after the last stage the columns into ``d``."""
    P, hg, rows = len(d.inside_pa), h * GAMMA, rows_of(c, b.links)
    time_s = state.clock[0] + TIMES[stage] * h
    b.motion.time_s[0] = c.start_s + time_s
    _known(c, state, stage, h, d, given, b, rows)
    _answered(c, given, s, stage, hg, b, rows)
    for at in range(len(given.driven)):
        drive = Table(table.start_s, table.step_s, given.drive[at])
        b.external[given.driven[at]] = pressure_in(drive, time_s)
    advance_inlet(c, given, w, s, stage, hg, d, b, rows)
    _moved_on(c, stage, hg, b, rows, P)
    for x in range(STATES):
        for p in range(P):
            b.inlet[stage, x, p] = (b.now_inlet[x, p] - b.known_inlet[x, p]) / hg
    if given.remembers:
        _remembered(c, stage, hg, b, rows)


@inlined
def advance_columns(
    c: Constants, given: Given, table: Table, w: Channel, state: State, h: float, s: Stages, d: Columns, b: Bench
) -> None:
    """Propagate the columns over an accepted step of h, whose stages are ``s``; ``state`` is still where it started."""
    P, rows, W, half = len(d.inside_pa), rows_of(c, b.links), b.sweeps.block.shape[2], d.qv.shape[1] // 2
    for stage in range(STAGES):
        _solve_stage(c, given, table, w, state, h, s, stage, d, b)
    end = STAGES - 1
    for i in range(c.cells):
        copy(b.sweeps.flat[i, rows.q * W : rows.q * W + half], d.qv[i, :half])
        copy(b.qv[end, i, :half], d.qv[i, half:])
    for x in range(STATES):
        for p in range(P):
            d.inlet[x, p] = b.now_inlet[x, p]
    if given.remembers:
        for i in range(c.cells):
            for j in range(2):
                for at in range(MEMORIES):
                    for y in range(2):
                        for p in range(P):
                            d.memory[i, j, at, y, p] = b.now_memory[i, j, at, y, p]


@compiled
def rest_columns(c: Constants, given: Given, q: Floats, first_pa: float, by_first_pa: Floats) -> Floats:
    """Derivatives of a rest state, (cells, moving, P), by the implicit function theorem.

    A stage so long that only displacements count; terms with memory do not change and exert no force at rest.
    """
    P, hg = len(by_first_pa), REST_S
    s, b = stages_for(c, len(q)), bench_for(c, given, P)
    s.q[0], s.inside_pa[0] = q, first_pa
    rows = rows_of(c, b.links)
    first: int = np.int64(0)  # type: ignore[assignment]  # numba would compile all of it once more for a literal 0
    _answered(c, given, s, first, hg, b, rows)
    out = np.empty((c.cells, 2 * c.active, P))
    for i in range(c.cells):
        for x in range(2 * c.active):
            for p in range(P):
                out[i, x, p] = hg * hg * (b.found[i, x, p] + by_first_pa[p] * b.found[i, x, P])
    return out
