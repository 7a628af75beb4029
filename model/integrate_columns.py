"""Integrates a straw and its derivatives side by side: the same steps as without, the columns taken along each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Columns, bench_for
from straw.model.columns import advance_columns
from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants
from straw.model.drive import Table, summed
from straw.model.given import Given
from straw.model.integrate import between, fill_inside, fill_start
from straw.model.scheme import STAGES
from straw.model.stages import Limits, Stages, State, arrive, stages_for, work_for
from straw.model.step import DONE, take_step
from straw.model.sweeps import wide

Floats = NDArray[np.float64]


class Outputs(NamedTuple):
    """Where a run is at its outputs."""

    q: Floats  # (outputs, coordinates)
    v: Floats
    inside_pa: Floats  # (outputs,)


class OutputsBy(NamedTuple):
    """Derivatives of the outputs by P parameters, and the snaps."""

    q: Floats  # (outputs, coordinates, P)
    inside_pa: Floats  # (outputs, P)
    inside_rate: Floats  # (outputs,) by time
    snaps: Floats  # (.., 3) first how many; then of each its cell from 0, its time s, its rate m/s
    snaps_by: Floats  # (.., P) s


@compiled
def integrate_columns(
    c: Constants,
    linear: Constants,
    given: Given,
    state: State,
    columns: Columns,
    table: Table,
    output_s: Floats,
    limits: Limits,
    out: Outputs,
    by: OutputsBy,
    counts: NDArray[np.int64],
) -> int:
    """`integrate` and its derivatives: ``by`` (outputs, ..) and the snaps of the even frusta; advances both in place.

    ``linear`` are the constants to linearise at, see `straw.model.given`.
    """
    n, P, sums = len(state.q), len(columns.inside_pa), summed(table)
    s, w, b = stages_for(c, n), work_for(c, n), bench_for(linear, given, P)
    before = Columns(columns.qv.copy(), columns.memory, columns.inlet, columns.inside_pa.copy())
    filled = fill_start(state, output_s, out.q, out.v, out.inside_pa)
    for at in range(filled):
        fill_columns(0.0, 1.0, before, columns, by, at)
    while state.clock[0] < limits.end_s:
        remaining = limits.end_s - state.clock[0]
        status, h = take_step(c, state, table, sums, limits, s, w, counts)
        if status != DONE:
            return status
        if P > 0:
            before.qv[:], before.inside_pa[:] = columns.qv, columns.inside_pa
            advance_columns(linear, given, table, w.channel, state, h, s, columns, b)
        new_s = limits.end_s if h == remaining else state.clock[0] + h
        start = filled
        filled = fill_inside(state, s, h, new_s, output_s, filled, out.q, out.v, out.inside_pa)
        for at in range(start, filled):
            fill_columns((output_s[at] - state.clock[0]) / h, h, before, columns, by, at)
            by.inside_rate[at] = (s.inside_pa[STAGES - 1] - state.clock[2]) / h
        find_snaps(c, state, s, h, before, columns, by)
        arrive(state, s, new_s)
    return DONE


@allocates_nothing
def fill_columns(x: float, h: float, start: Columns, end: Columns, by: OutputsBy, at: int) -> None:
    """Derivatives of the output that lies a share x into a step of h: those of what `fill_inside` does."""
    cells, P = len(end.qv), len(end.inside_pa)
    W, moving = wide(P + 1), by.q.shape[1] // cells
    for p in range(P):
        by.inside_pa[at, p] = start.inside_pa[p] + x * (end.inside_pa[p] - start.inside_pa[p])
    for i in range(cells):
        for z in range(moving):
            q, v = z * W, (moving + z) * W
            q0, v0, q1, v1 = start.qv[i, q:], start.qv[i, v:], end.qv[i, q:], end.qv[i, v:]
            out = by.q[at, z * cells + i]
            for p in range(np.uint64(P)):
                out[p], _ = between(x, h, q0[p], v0[p], q1[p], v1[p])


@allocates_nothing
def find_snaps(c: Constants, state: State, s: Stages, h: float, start: Columns, end: Columns, by: OutputsBy) -> None:
    """Note where an even frustum passes zeta = 0 within the step, how fast, and how that moment changes."""
    last = STAGES - 1
    for i in range(c.cells):
        at = (c.active - 1) * c.cells + i
        q0, v0, q1, v1 = state.q[at], state.v[at], s.q[last, at], s.v[last, at]
        n = int(by.snaps[0, 0])
        if (q0 > 0) == (q1 > 0) or n + 1 >= len(by.snaps):
            continue
        low, high = 0.0, 1.0
        for _ in range(50):
            x = (low + high) / 2
            value, _ = between(x, h, q0, v0, q1, v1)
            if (value > 0) == (q0 > 0):
                low = x
            else:
                high = x
        x = (low + high) / 2
        _, rate = between(x, h, q0, v0, q1, v1)
        n += 1
        by.snaps[0, 0] = n
        by.snaps[n, 0], by.snaps[n, 1], by.snaps[n, 2] = i, state.clock[0] + x * h, rate
        P = len(end.inside_pa)
        q, v = (c.active - 1) * wide(P + 1), (3 * c.active - 1) * wide(P + 1)
        for p in range(P):
            change, _ = between(x, h, start.qv[i, q + p], start.qv[i, v + p], end.qv[i, q + p], end.qv[i, v + p])
            by.snaps_by[n, p] = -change / rate
