"""A law's value at a state of the system, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.codes import OF_INPUT, OF_RATE, OF_SHOWN, OF_SPEED, OF_STATE, OF_TIME
from straw.replay.diagnose.systems.function.compiled import compiled
from straw.replay.diagnose.systems.function.shapes import FOLLOWS, PLAY, YIELDS, value

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@compiled
def speed_of(which: int, x: Floats) -> float:
    """Magnitude of the states whose bits are set in ``which``."""
    total, i = 0.0, 0
    while which >> i > 0:
        if (which >> i) & 1:
            total += x[i] ** 2
        i += 1
    return float(np.sqrt(total))


@compiled
def state_of(kind: int, which: int, t: float, x: Floats, rates: Floats, u: Floats, y: Floats) -> float:
    """A state's value."""
    if kind == OF_STATE:
        return float(x[which])
    if kind == OF_RATE:
        return float(rates[which])
    if kind == OF_INPUT:
        return float(u[which])
    if kind == OF_TIME:
        return t
    if kind == OF_SHOWN:
        return float(y[which])
    if kind == OF_SPEED:
        return speed_of(which, x)
    return 1.0


@compiled
def within(s: float, middle: float, half_width: float) -> float:
    """A value taken along by a play around another (Krasnosel'skii and Pokrovskii 1989)."""
    return min(max(s, middle - half_width), middle + half_width)


@compiled
def ahead_of(z: float, moved: float, half_width: float) -> float:
    """How far a value is ahead of what follows it with a gradual play, after it moved: dz/ds = 1 -+ z / half_width
    forwards and backwards (Dahl 1968), from z."""
    fade = np.exp(-abs(moved) / half_width)
    return float(z * fade + np.sign(moved) * half_width * (1 - fade))


@compiled
def law_at(
    m: int, rows: Indices, p: Floats, t: float, x: Floats, rates: Floats, u: Floats, y: Floats, states: int
) -> float:
    """A law's value."""
    late, own = rows[m, 7] >= 0, rows[m, 4] == FOLLOWS or rows[m, 4] == PLAY or rows[m, 4] == YIELDS
    now = state_of(rows[m, 2], rows[m, 3], t, x, rates, u, y) if own or not late else 0.0
    s = float(x[states + rows[m, 7]]) if late else now
    if rows[m, 4] == PLAY:
        s = within(s, now, p[rows[m, 5] - 1])
    if rows[m, 4] == YIELDS:
        k = states + rows[m, 7]
        s = now - ahead_of(x[k], now - x[k + 1], p[rows[m, 5] - 1])
    if own:
        s -= now
    return float(value(rows[m, 4], p, rows[m, 5], rows[m, 6], s))
