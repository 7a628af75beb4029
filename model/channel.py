"""The inlet: from the controller's pressure through line and channel to the pressure inside the straw.

Base model (equation 2):      p_in = p_c - K Q|Q|,  K = rho / (2 pi^2 r_ch^4),  Q = V' the rate of the straw's volume.
With optional effects:        I Q' = p_r - p_in - R Q - K Q|Q|      fluid_inertia, poiseuille_loss
                              p_r' = (p_c - p_r) / tau - Q / C      line_lag (p_r = p_c without)
                              v' = V' - Q,  p_in = p_0 ((V_g/v)^n - 1)  trapped_gas (Q = V' without)
and, where `straw diagnose` found no law for them, tables: l(Q) beside K Q|Q|, and g(p_in) that leaks through the wall,
beside V'.
Within an implicit step the inlet is one equation for Q; the straw needs only the pressure and its derivative by V'.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.constants import Constants
from straw.model.table import POINTS, empty, table, table_moved
from straw.model.terms import COLUMNS

Floats = NDArray[np.float64]

AMBIENT_PA = 101_325.0
INERTANCE = COLUMNS["fluid_inertia"][0]
RESISTANCE = COLUMNS["poiseuille_loss"][0]
LAG, LINE_AIR = COLUMNS["line_lag"][0], COLUMNS["line_lag"][0] + 1
GAS, EXPONENT = COLUMNS["trapped_gas"][0], COLUMNS["trapped_gas"][0] + 1
MISSING = COLUMNS["missing_loss"][0]
LEAK = 1 + 2 * POINTS  # in `Channel.more`
CYCLES = MISSING + 1 + 4 * POINTS

#: States of the inlet: pressure of the reservoir (Pa), flow through the channel (m^3/s), gas inside (m^3).
STATES = 3
NEWTON_LIMIT = 30
#: Steps for the slopes of tables, m^3/s and Pa.
NEARBY, NEARBY_PA = 1e-9, 1.0


class Channel(NamedTuple):
    """Constants of the inlet; those of effects outside the base model are zero there."""

    loss: float  # K, Pa s^2/m^6
    resistance: float  # R, Pa s/m^3
    inertance: float  # I, kg/m^4
    lag_s: float  # tau
    line_pa_per_m3: float  # 1 / C
    gas_m3: float  # V_g
    exponent: float  # n
    more: Floats  # amount; l(Q), a table of points (m^3/s) and values (Pa); g(p), of points (Pa) and values (m^3/s)
    leaks: bool  # whether g is not zero


@compiled
def channel_of(c: Constants) -> Channel:
    """The straw's channel and line."""
    k = c.terms[0, 0]
    loss = c.loss
    if k[MISSING] != 0:
        loss *= 1 + k[MISSING] * table(c.cycle, k, CYCLES)
    line = AMBIENT_PA / k[LINE_AIR]
    leaks = k[MISSING] != 0 and not empty(k, MISSING + LEAK)
    return Channel(loss, k[RESISTANCE], k[INERTANCE], k[LAG], line, k[GAS], k[EXPONENT], k[MISSING:CYCLES], leaks)


@exposed
def lost(w: Channel, flow: float) -> tuple[float, float]:
    """Pressure (Pa) lost to what is quadratic in the flow or in a table, and its slope by the flow."""
    pressure, slope = w.loss * flow * abs(flow), 2 * w.loss * abs(flow)
    if w.more[0] != 0:
        pressure += w.more[0] * table(flow, w.more, 1)
        up, down = table(flow + NEARBY, w.more, 1), table(flow - NEARBY, w.more, 1)
        slope += w.more[0] * (up - down) / (2 * NEARBY)
    return pressure, slope


@exposed
def lost_to_table_moved(w: Channel, flow: float, by: Floats) -> float:
    """Derivative of the pressure (Pa) lost to the table where it moves as ``by``, amount first."""
    if w.more[0] == 0 and by[0] == 0:
        return 0.0
    return float(by[0] * table(flow, w.more, 1) + w.more[0] * table_moved(flow, w.more, 1, by))


@exposed
def leaked(w: Channel, inside_pa: float) -> tuple[float, float]:
    """Flow out through the wall (m^3/s), and its slope by the pressure inside."""
    if not w.leaks:
        return 0.0, 0.0
    up, down = table(inside_pa + NEARBY_PA, w.more, LEAK), table(inside_pa - NEARBY_PA, w.more, LEAK)
    return w.more[0] * table(inside_pa, w.more, LEAK), w.more[0] * (up - down) / (2 * NEARBY_PA)


@exposed
def leaked_moved(w: Channel, inside_pa: float, by: Floats) -> float:
    """Derivative of the flow out through the wall where its table moves as ``by``, amount first."""
    if w.more[0] == 0 and by[0] == 0:
        return 0.0
    return float(by[0] * table(inside_pa, w.more, LEAK) + w.more[0] * table_moved(inside_pa, w.more, LEAK, by))


@allocates_nothing
def with_leak(
    w: Channel, source: float, linear: float, rate_m3_per_s: float, gas_m3: float, step_s: float
) -> tuple[float, float, float]:
    """Pressure inside, its slope by the volume's rate, and the flow, where p_in = source - linear Q - lost(Q) and the
    wall leaks; ``gas_m3`` is the gas from which a step of ``step_s`` starts. At rest the step is infinite."""
    inside = source - linear * rate_m3_per_s
    low, high, flow, more = -math.inf, math.inf, 0.0, 0.0
    for _ in range(NEWTON_LIMIT):
        leak, more = leaked(w, inside)
        flow = rate_m3_per_s + leak
        if w.gas_m3 > 0:
            inside = max(inside, -0.99 * AMBIENT_PA)
            gas = w.gas_m3 * (1 + inside / AMBIENT_PA) ** (-1 / w.exponent)
            flow -= (gas - gas_m3) / step_s
            more += gas / (w.exponent * (AMBIENT_PA + inside) * step_s)
        drop, steep = lost(w, flow)
        resists = linear + steep
        wrong = inside - source + linear * flow + drop
        if wrong > 0:
            high = inside
        else:
            low = inside
        new = inside - wrong / (1 + resists * more)
        if not low <= new <= high and high - low < math.inf:  # from one end of a table to the other and back
            new = (low + high) / 2
        change, inside = new - inside, new
        if abs(change) <= 1e-9 * (abs(inside) + 1):
            break
    resists = linear + lost(w, flow)[1]
    return inside, -resists / (1 + resists * more), flow


@compiled
def still_pressure(w: Channel, external_pa: float, rate_m3_per_s: float) -> tuple[float, float]:
    """Pressure inside (Pa) and flow (m^3/s) where nothing in the inlet changes but the straw's volume, at a rate."""
    linear = w.resistance + w.lag_s * w.line_pa_per_m3
    if w.leaks:
        inside, _, flow = with_leak(w, external_pa, linear, rate_m3_per_s, 0.0, math.inf)
        return inside, flow
    return float(external_pa - lost(w, rate_m3_per_s)[0] - linear * rate_m3_per_s), rate_m3_per_s


@compiled
def channel_at_rest(c: Constants, external_pa: float) -> tuple[Floats, float]:
    """States of the inlet of a straw at rest, and the pressure inside (Pa)."""
    w = channel_of(c)
    inside, flow = still_pressure(w, external_pa, 0.0)
    gas = w.gas_m3 / (1 + inside / AMBIENT_PA) ** (1 / w.exponent)
    return np.array([external_pa - w.lag_s * w.line_pa_per_m3 * flow, flow, gas]), inside


@exposed
def inside_pressure(
    w: Channel, known: Floats, step_s: float, external_pa: float, rate_m3_per_s: float, now: Floats
) -> tuple[float, float]:
    """Pressure inside (Pa) and its slope by the volume's rate, after an implicit step.

    ``known`` are the states a step of ``step_s`` starts from (state = known + step_s state'); ``now`` gets those at
    its end.
    """
    source, fall = external_pa, 0.0  # p_r = source - fall Q
    if w.lag_s > 0:
        source = (known[0] + step_s / w.lag_s * external_pa) / (1 + step_s / w.lag_s)
        fall = step_s * w.line_pa_per_m3 / (1 + step_s / w.lag_s)
    inertia = w.inertance / step_s if w.inertance > 0 else 0.0
    linear = fall + w.resistance + inertia
    source += inertia * known[1]
    if w.leaks:
        inside, slope, flow = with_leak(w, source, linear, rate_m3_per_s, known[2], step_s)
        now[1] = flow
        now[2] = w.gas_m3 * (1 + inside / AMBIENT_PA) ** (-1 / w.exponent)
    elif w.gas_m3 > 0:
        flow = now[1]
        for _ in range(NEWTON_LIMIT):
            gas = known[2] + step_s * (rate_m3_per_s - flow)
            gas = max(gas, 1e-3 * w.gas_m3)
            inside = AMBIENT_PA * ((w.gas_m3 / gas) ** w.exponent - 1)
            spring = step_s * w.exponent * (inside + AMBIENT_PA) / gas
            drop, steep = lost(w, flow)
            wrong = linear * flow + drop + inside - source
            change = wrong / (linear + steep + spring)
            flow -= change
            if abs(change) <= 1e-12 * (abs(flow) + 1e-9):
                break
        resists = linear + lost(w, flow)[1]
        now[1] = flow
        now[2] = known[2] + step_s * (rate_m3_per_s - flow)
        slope = -spring * resists / (spring + resists)
    else:
        flow = rate_m3_per_s
        drop, steep = lost(w, flow)
        inside = source - linear * flow - drop
        slope = -linear - steep
        now[1], now[2] = flow, 0.0
    now[0] = (source - inertia * known[1]) - fall * flow
    return inside, slope


class InletSlopes(NamedTuple):
    """The inlet after an implicit step, linearised: pressures p_r and inside, flow Q, gas v, see `inlet_slopes`."""

    reservoir: float  # p_r by its known state
    external: float  # p_r by the external pressure
    drain: float  # -p_r by Q
    resists: float  # -(inside) by Q
    inertia: float  # inside by the known flow
    gas: float  # v by the inside pressure
    gas_by_volume: float  # v by V_g
    gas_by_exponent: float


@exposed
def inlet_slopes(w: Channel, step_s: float, inside_pa: float, flow: float) -> InletSlopes:
    """Linear response of the inlet; also valid in the limit of zero lag, gas or inertia."""
    time_s = w.lag_s + step_s
    drain = w.lag_s * step_s * w.line_pa_per_m3 / time_s
    inertia = w.inertance / step_s
    resists = drain + w.resistance + inertia + lost(w, flow)[1]
    squeezed = math.log(1 + inside_pa / AMBIENT_PA) / w.exponent
    share = math.exp(-squeezed)
    gas = -w.gas_m3 * share / (w.exponent * (AMBIENT_PA + inside_pa))
    by_exponent = w.gas_m3 * share * squeezed / w.exponent
    return InletSlopes(w.lag_s / time_s, step_s / time_s, drain, resists, inertia, gas, share, by_exponent)
