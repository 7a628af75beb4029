"""A run and its exact derivatives: by constants, terms, pressure and start, carried through the integrator's own steps.

The derivative of the discrete solution at fixed steps: no finite differences between runs, no increment to choose.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Columns
from straw.model.channel import (
    STATES,
    channel_of,
    inlet_slopes,
    leaked,
    leaked_moved,
    lost,
    lost_to_table_moved,
    still_pressure,
)
from straw.model.columns import rest_columns
from straw.model.compiled import compiled
from straw.model.constants import Constants
from straw.model.crossing import Crossing, crossings
from straw.model.direction import SCALARS, Direction
from straw.model.drive import Table
from straw.model.frusta import MEMORIES, MEMORY_TERMS
from straw.model.given import Given, given, linearised
from straw.model.integrate import FIRST_STEPS, at_rest
from straw.model.integrate_columns import Outputs, OutputsBy, integrate_columns
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import (
    FIRST_STEP_S,
    MAX_STEP_S,
    MOST_STEPS_PER_S,
    TOLERANCE_M,
    Prediction,
    check_status,
    per_frustum,
    prediction,
    sampled,
)
from straw.model.stages import limits_for
from straw.model.sweeps import wide
from straw.model.terms import COLUMNS

Floats = NDArray[np.float64]

#: Most snaps recorded of each cell, those of its ringing included.
MOST_SNAPS = 100


@dataclass(frozen=True)
class Rates:
    """Derivatives of a run's channels by time, (n,)."""

    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    pressure_pa: Floats
    volume_m3: Floats
    zeta_m: Floats  # (n, cells, 2)
    frustum_phi_rad: Floats


@dataclass(frozen=True)
class Derivatives:
    """A prediction, and the derivatives of its channels by P parameters, (n, P), SI by the parameter's unit."""

    prediction: Prediction
    names: tuple[str, ...]  # of the directions
    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    pressure_pa: Floats
    volume_m3: Floats
    by_time: Rates  # minus the effect of shifting the whole run to later
    snaps: tuple[Crossing, ...]  # where the even frusta pass the middle between folded and deployed, zeta = 0
    rest: Floats  # (coordinates, P)
    coordinates: Floats | None = None  # (n, coordinates, P), where asked for
    rigid: Floats | None = None  # (cells, P) of the heights of frusta that do not move

    @cached_property
    def zeta_m(self) -> Floats | None:
        """Derivatives of every frustum's zeta, (n, cells, 2, P); None where the cells were not asked for."""
        return self._by_frustum(0, self.rigid)

    @cached_property
    def frustum_phi_rad(self) -> Floats | None:
        """Derivatives of every frustum's phi, (n, cells, 2, P); None where the cells were not asked for."""
        return self._by_frustum(1, 0.0)

    def _by_frustum(self, which: int, rigid: Floats | float | None) -> Floats | None:
        """From coordinates in the order zeta, phi, each of the odd frusta, if they move, and of the even ones."""
        if self.coordinates is None or self.rigid is None:
            return None
        n, many, P = len(self.rigid), len(self.coordinates), self.coordinates.shape[-1]
        moving = self.coordinates.reshape(many, 2, -1, n, P)[:, which]
        out = np.empty((many, n, 2, P))
        out[:, :, 0] = rigid
        for j in range(moving.shape[1]):
            out[:, :, j + 2 - moving.shape[1]] = moving[:, j]
        return out

    def crossings(self, channel: str, level: float) -> list[Crossing]:
        """Where "x_m", "z_m", "phi_rad", "pressure_pa" or "volume_m3" passes a level, in time."""
        value, rate = getattr(self.prediction, channel), getattr(self.by_time, channel)
        return crossings(self.prediction.time_s, value - level, rate, getattr(self, channel))


def differentiate(
    straw: StrawParameters,
    pressure: Callable[[Floats], Floats] | Table,
    time_s: Floats,
    deployed: Collection[int],
    directions: Sequence[Direction],
    *,
    tolerance_m: float = TOLERANCE_M,
    near: Floats | None = None,
    most_steps_per_s: float = MOST_STEPS_PER_S,
    cells: bool = False,
) -> Derivatives:
    """`straw.model.simulate.simulate` (the same prediction to the last bit) and its derivatives along directions.

    ``pressure`` may be `sampled` already. With ``cells`` the derivatives of every frustum's zeta and phi come along.
    Raises ModelError where `simulate` does, and for a direction of another straw.
    """
    table = pressure if isinstance(pressure, Table) else sampled(pressure, time_s)
    time_s = np.require(time_s, np.float64, ("C", "W"))
    table = table._replace(pressure_pa=np.require(table.pressure_pa, np.float64, ("C", "W")))
    c, P = straw.constants(), len(directions)
    q = rest_state(straw, deployed, float(table.pressure_pa[0]), near=near)
    changes, linear = given(straw, table, directions), linearised(straw, directions)
    columns, at_start = _start(straw, changes, linear, table, q, directions)
    rest = at_start.transpose(1, 0, 2).reshape(len(q), P)
    state, counts = at_rest(c, q, float(time_s[0]), float(table.pressure_pa[0]), FIRST_STEP_S), np.zeros(4, np.int64)
    out, by = _room(straw, len(time_s), P)
    end_s = float(time_s[-1])
    steps = FIRST_STEPS + int(most_steps_per_s * (end_s - float(time_s[0])))
    limits = limits_for(c, end_s, MAX_STEP_S, tolerance_m, steps)
    status = integrate_columns(c, linear, changes, state, columns, table, time_s, limits, out, by, counts)
    check_status(status, float(state.clock[0]))
    x_m, z_m, phi_rad, volume_m3 = _seen(c, out.q, by.q, changes.scalars, changes.odd)
    snaps = slice(1, int(by.snaps[0, 0]) + 1)
    return Derivatives(
        prediction(straw, table, time_s, out.q, out.inside_pa, counts, q),
        tuple(d.name for d in directions),
        x_m,
        z_m,
        phi_rad,
        by.inside_pa,
        volume_m3,
        _rates(straw, out, by),
        tuple(
            Crossing(float(at), float(rate), change, int(cell) + 1)
            for (cell, at, rate), change in zip(by.snaps[snaps], by.snaps_by[snaps], strict=True)
            if rate
        ),
        rest,
        *((by.q, changes.odd) if cells else ()),
    )


def _room(straw: StrawParameters, many: int, P: int) -> tuple[Outputs, OutputsBy]:
    """Allocate the outputs and their derivatives."""
    n, most = straw.coordinates, MOST_SNAPS * straw.cells + 1
    out = Outputs(np.empty((many, n)), np.empty((many, n)), np.empty(many))
    by_q, by_pa = np.empty((many, n, P)), np.empty((many, P))
    return out, OutputsBy(by_q, by_pa, np.zeros(many), np.zeros((most, 3)), np.zeros((most, P)))


def _rates(straw: StrawParameters, out: Outputs, by: OutputsBy) -> Rates:
    """Derivatives of all channels by time; rigid frusta have none."""
    nothing = np.zeros((len(SCALARS), 1)), np.zeros((straw.cells, 1))
    x_m, z_m, phi_rad, volume_m3 = (
        x[:, 0] for x in _seen(straw.constants(), out.q, out.v[:, :, np.newaxis].copy(), *nothing)
    )
    zeta, phi = per_frustum(straw, out.v)
    if straw.form == "truncated":
        zeta[:, :, 0] = 0.0
    return Rates(x_m, z_m, phi_rad, by.inside_rate, volume_m3, zeta, phi)


def _start(
    straw: StrawParameters, changes: Given, linear: Constants, table: Table, q: Floats, directions: Sequence[Direction]
) -> tuple[Columns, Floats]:
    """Where the columns start: how the rest state, (cells, moving, P) once more, and the states of the inlet change."""
    P, n, moving, first_pa = len(directions), straw.cells, len(q) // straw.cells, float(table.pressure_pa[0])
    by_first_pa, inlet = np.zeros(P), np.zeros((STATES, P))
    by_first_pa[changes.driven] = changes.drive[:, 0]
    still = linear.terms.copy()
    for name in MEMORY_TERMS:  # whose memory is zero at rest
        still[:, :, COLUMNS[name][0]] = 0.0
    channel, moved, tables = channel_of(straw.constants()), changes.inlet, changes.inlet_tables
    inside_pa, flow = still_pressure(channel, first_pa, 0.0)
    drain = channel.lag_s * channel.line_pa_per_m3
    by_drain = moved[3] * channel.line_pa_per_m3 + channel.lag_s * moved[4]
    drop = moved[0] * flow * abs(flow) + (moved[1] + by_drain) * flow
    drop += np.array([lost_to_table_moved(channel, flow, by) for by in tables])
    leak, resists = leaked(channel, inside_pa)[1], channel.resistance + drain + lost(channel, flow)[1]
    by_leak = np.array([leaked_moved(channel, inside_pa, by) for by in tables])
    by_inside = (by_first_pa - drop - resists * by_leak) / (1 + resists * leak)
    by_flow = by_leak + leak * by_inside
    at_rest = linear._replace(terms=still, remembers=False)
    rest = rest_columns(at_rest, changes, q, inside_pa, by_inside)
    for p, direction in enumerate(directions):
        if direction.start is not None:
            rest[:, :, p] += direction.start.reshape(moving, n).T
    gas = inlet_slopes(channel, 1.0, inside_pa, flow)
    inlet[0] = by_first_pa - by_drain * flow - drain * by_flow
    inlet[1] = by_flow
    inlet[2] = gas.gas * by_inside + gas.gas_by_volume * moved[5] + gas.gas_by_exponent * moved[6]
    memory = np.zeros((n, 2, MEMORIES, 2, P if changes.remembers else 0))
    qv = np.zeros((n, 2 * moving, wide(P + 1)))
    qv[:, :moving, :P] = rest
    return Columns(qv.reshape(n, -1), memory, inlet, by_inside), rest


@compiled
def _seen(c: Constants, q: Floats, by: Floats, scalars: Floats, odd: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Derivatives of tip X, Z, Phi and volume, (m, P), by those of q (m, coordinates, P) and constants (.., P)."""
    m, P, n, k = len(q), by.shape[2], c.cells, c.active
    x_m, z_m, phi_rad, volume_m3 = np.zeros((m, P)), np.zeros((m, P)), np.zeros((m, P)), np.zeros((m, P))
    angle_by = np.empty(P)
    for r in range(m):
        angle, height = c.phi_0, 0.0
        angle_by[:] = scalars[4]
        for i in range(n):
            length = q[r, (k - 1) * n + i] + (q[r, i] if k == 2 else c.zeta0[i, 0])
            height += length
            if k == 2:
                angle += q[r, 2 * n + i]
                angle_by += by[r, 2 * n + i]
            ux, uz = np.sin(angle), np.cos(angle)
            for p in range(P):
                longer = by[r, (k - 1) * n + i, p] + (by[r, i, p] if k == 2 else odd[i, p])
                x_m[r, p] += longer * ux + length * uz * angle_by[p]
                z_m[r, p] += longer * uz - length * ux * angle_by[p]
                volume_m3[r, p] += c.S * longer
            angle += q[r, (2 * k - 1) * n + i]
            angle_by += by[r, (2 * k - 1) * n + i]
        phi_rad[r] = angle_by
        volume_m3[r] += scalars[11] * height
    return x_m, z_m, phi_rad, volume_m3
