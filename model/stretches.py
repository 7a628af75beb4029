"""Runs of any length: integrated where something happens, skipped where the straw rests under a pressure that holds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.integrate import at_rest, integrate
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import FIRST_STEP_S, MAX_STEP_S, MOST_STEPS_PER_S, TOLERANCE_M, check_status, sampled
from straw.model.step import LEVER_M
from straw.model.straw import seen

Floats = NDArray[np.float64]

CHUNK_S = 1.0
#: It rests when nothing moved by more than this in ``CHUNK_S``: a tenth of what an integration step is good to. Creep
#: that is slower (0.36 mm in an hour at most) is left out of a rest that is skipped.
STILL_M = 0.1 * TOLERANCE_M  # an angle counts by the lever of the tip, as in an integration step


@dataclass(frozen=True)
class Stretch:
    """A piece of a run up to ``end_s``; ``holds`` where the command does not change within it."""

    end_s: float
    holds: bool


@dataclass(frozen=True)
class LongPrediction:
    """The tip and the pressure inside, arrays (n,), SI; dense where it moves, and the ends of every rest."""

    time_s: Floats
    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    pressure_pa: Floats
    volume_m3: Floats
    skipped_s: float


def simulate_stretches(
    straw: StrawParameters,
    pressure: Callable[[Floats], Floats],
    stretches: Sequence[Stretch],
    deployed: Collection[int],
    *,
    rate_hz: float,
    window_s: tuple[float, float],
    progress: Callable[[float, float], None] = lambda done_s, whole_s: None,
) -> LongPrediction:
    """Motion from rest at 0 s, as ``simulate`` gives it, with outputs at ``rate_hz`` within ``window_s`` only.

    Costs the time in which the straw moves, not the time that passes. Raises ModelError as ``simulate`` does.
    """
    c = straw.constants()
    first_pa = float(pressure(np.zeros(1))[0])
    q = rest_state(straw, deployed, first_pa)
    state = at_rest(c, q, 0.0, first_pa, FIRST_STEP_S)
    pieces: list[tuple[Floats, ...]] = []
    end_s, skipped_s, now_s = min(stretches[-1].end_s, window_s[1]), 0.0, 0.0

    def run_on(for_s: float, output_s: Floats) -> None:
        # In the time of this piece: after weeks, seconds as floats could not resolve a small step.
        state.clock[0] = 0.0
        table = sampled(lambda t: pressure(t + now_s), np.array([0.0, for_s]))
        n = len(output_s)
        out_q, out_v, out_pa = np.empty((n, len(q))), np.empty((n, len(q))), np.empty(n)
        counts, since_s = np.zeros(4, np.int64), np.maximum(output_s - now_s, 0.0)
        status = integrate(
            c, state, table, since_s, for_s, TOLERANCE_M, MAX_STEP_S, MOST_STEPS_PER_S, out_q, out_v, out_pa, counts
        )
        check_status(status, now_s + float(state.clock[0]))
        if n:
            pieces.append((output_s, *seen(c, out_q), out_pa))

    for stretch in stretches:
        last_s = min(stretch.end_s, end_s)
        while now_s < last_s:
            until_s = min(now_s + CHUNK_S, last_s)
            before = state.q.copy()
            ticks = np.arange(np.ceil(now_s * rate_hz), np.ceil(until_s * rate_hz)) / rate_hz
            run_on(until_s - now_s, ticks[(ticks >= max(window_s[0], now_s)) & (ticks < until_s)])
            now_s = until_s
            progress(now_s, end_s)
            if stretch.holds and _moved(state.q - before) < STILL_M and last_s - CHUNK_S > now_s:
                skipped_s += last_s - CHUNK_S - now_s
                now_s = last_s - CHUNK_S
    times, x_m, z_m, phi_rad, volume_m3, pressure_pa = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return LongPrediction(times, x_m, z_m, phi_rad, pressure_pa, volume_m3, skipped_s)


def _moved(change: Floats) -> float:
    """The largest displacement (m); the first half of the coordinates are heights, the second angles."""
    n = len(change) // 2
    return float(max(np.max(np.abs(change[:n])), LEVER_M * np.max(np.abs(change[n:]))))
