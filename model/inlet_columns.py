"""The inlet, linearised for all columns: closes the loop from the flow to the pressure inside and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Bench, Columns, add
from straw.model.channel import Channel, inlet_slopes, leaked, leaked_moved, lost_to_table_moved
from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.given import AREA, Given
from straw.model.stages import Stages
from straw.model.straw import volume_rate
from straw.model.sweeps import Rows
from straw.model.vectors import plus

Floats = NDArray[np.float64]


@allocates_nothing
def advance_inlet(
    c: Constants, given: Given, w: Channel, s: Stages, stage: int, hg: float, d: Columns, b: Bench, rows: Rows
) -> None:
    """Close the loop through the inlet: the pressure inside, also into the bench, and the states of the inlet."""
    P, n = len(d.inside_pa), c.cells
    inside_pa, flow, known = s.inside_pa[stage], s.inlet[stage, 1], s.known_inlet[stage]
    slopes = inlet_slopes(w, hg, inside_pa, flow)
    per_pa = 0.0
    for i in range(n):
        for x in range(c.active):
            per_pa += c.S * hg * b.found[i, x, P]
    per_pa += leaked(w, inside_pa)[1]
    rate = volume_rate(c, s.v[stage]) / c.S
    for p in range(np.uint64(len(b.flow))):
        b.flow[p] = 0.0
    for i in range(n):
        for x in range(c.active):
            plus(b.flow, c.S, b.sweeps.block[i, rows.v + x], b.flow)
            plus(b.flow, c.S * hg, b.found[i, x], b.flow)
    add(rate, given.scalars[AREA], b.flow[:P])
    reservoir_pa, time_s = s.inlet[stage, 0], w.lag_s + hg
    for p in range(P):
        moved = given.inlet[:, p]
        lag = moved[3] * (known[0] - reservoir_pa - hg * w.line_pa_per_m3 * flow) - w.lag_s * hg * flow * moved[4]
        at_rest = slopes.reservoir * b.known_inlet[0, p] + slopes.external * b.external[p] + lag / time_s
        drop = moved[0] * flow * abs(flow) + moved[1] * flow + moved[2] * (flow - known[1]) / hg
        drop += lost_to_table_moved(w, flow, given.inlet_tables[p])
        at_rest += slopes.inertia * b.known_inlet[1, p] - drop
        gas = slopes.gas_by_volume * moved[5] + slopes.gas_by_exponent * moved[6]
        # inside = at_rest - resists Q,  Q = V' + leak + (known gas - gas) / hg,  these in turn by the pressure inside
        still = b.flow[p] + leaked_moved(w, inside_pa, given.inlet_tables[p]) + (b.known_inlet[2, p] - gas) / hg
        inside = (at_rest - slopes.resists * still) / (1 + slopes.resists * (per_pa - slopes.gas / hg))
        d.inside_pa[p] = b.inside_pa[p] = inside
        passes = still + (per_pa - slopes.gas / hg) * inside
        b.now_inlet[1, p] = passes
        b.now_inlet[0, p] = slopes.reservoir * b.known_inlet[0, p] + slopes.external * b.external[p]
        b.now_inlet[0, p] += lag / time_s - slopes.drain * passes
        b.now_inlet[2, p] = gas + slopes.gas * inside
