"""Integrates the straw in second-order form: an L-stable SDIRK method on the residual, never on M^-1.

Each stage solves forces_left(q, v, a) = 0 by a simplified Newton whose matrix M / (h gamma)^2 + C / (h gamma) + K has
one row a coordinate, half of what the first-order form needs. Working on the residual matters in the full form:
there M is singular (each cell's fluid is one rigid body with three velocities but has four coordinates).
States of first order (memories of the frusta, the inlet) are solved for within a stage and need no rows.
Error control uses q, which the camera observes; kHz modes below the tolerance are damped, not resolved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.channel import channel_at_rest
from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants
from straw.model.drive import Table, summed
from straw.model.frusta import MEMORIES
from straw.model.scheme import STAGES
from straw.model.stages import Stages, State, arrive, copy, limits_for, stages_for, work_for
from straw.model.step import DONE, take_step

Floats = NDArray[np.float64]

#: Steps allowed beside those each second may take, to begin with.
FIRST_STEPS = 1_000


@compiled
def at_rest(c: Constants, q: Floats, time_s: float, external_pa: float, first_step_s: float) -> State:
    """The state of a straw that rests at q."""
    inlet, inside_pa = channel_at_rest(c, external_pa)
    return State(
        q.copy(),
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros((c.cells, 2, MEMORIES, 2)),
        inlet,
        np.array([time_s, first_step_s, inside_pa]),
    )


@allocates_nothing
def between(x: float, h: float, q0: float, v0: float, q1: float, v1: float) -> tuple[float, float]:
    """Value and rate at a share x of a step of h on the cubic through values and rates at both of its ends."""
    d = q1 - q0
    value = q0 + x * (h * v0 + x * (3 * d - h * (2 * v0 + v1) + x * (h * (v0 + v1) - 2 * d)))
    return value, v0 + x * (2 * (3 * d / h - 2 * v0 - v1) + 3 * x * (v0 + v1 - 2 * d / h))


@allocates_nothing
def fill_inside(
    state: State, s: Stages, h: float, new_s: float, output_s: Floats, filled: int, q: Floats, v: Floats, pa: Floats
) -> int:
    """Fill the outputs that lie within a step, from ``filled`` on; how many there are now."""
    end = STAGES - 1
    while filled < len(output_s) and output_s[filled] <= new_s:
        x = (output_s[filled] - state.clock[0]) / h
        pa[filled] = state.clock[2] + x * (s.inside_pa[end] - state.clock[2])
        for j in range(len(state.q)):
            q[filled, j], v[filled, j] = between(x, h, state.q[j], state.v[j], s.q[end, j], s.v[end, j])
        filled += 1
    return filled


@allocates_nothing
def fill_start(state: State, output_s: Floats, q: Floats, v: Floats, pa: Floats) -> int:
    """Fill the outputs up to the start; how many there are."""
    filled = 0
    while filled < len(output_s) and output_s[filled] <= state.clock[0]:
        copy(state.q, q[filled])
        copy(state.v, v[filled])
        pa[filled] = state.clock[2]
        filled += 1
    return filled


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
    n, start_s, sums = len(state.q), state.clock[0], summed(table)
    most = counts[0] + counts[1] + FIRST_STEPS + int(most_steps_per_s * (end_s - start_s))
    limits = limits_for(c, end_s, max_step_s, tolerance_m, most)
    s, w = stages_for(c, n), work_for(c, n)
    filled = fill_start(state, output_s, out_q, out_v, out_pa)
    while state.clock[0] < end_s:
        remaining = end_s - state.clock[0]
        status, h = take_step(c, state, table, sums, limits, s, w, counts)
        if status != DONE:
            return status
        new_s = end_s if h == remaining else state.clock[0] + h
        filled = fill_inside(state, s, h, new_s, output_s, filled, out_q, out_v, out_pa)
        arrive(state, s, new_s)
    return DONE
