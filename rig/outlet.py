"""Outlet: the exact response of a controller of nominal speed to a protocol, from the protocol's points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.rig.plant import PressurePlant
from straw.rig.protocol import PressureProtocol

Floats = NDArray[np.float64]


class Outlet:
    """Outlet pressure (Pa) as a function of seconds since the protocol's start, from vented.

    The controller answers as ``PressurePlant`` does, dP/dt = k (P_set - P) with P_set within its supply. Where P_set
    is straight, c + s t, the response is c + s t - s/k + (P0 - c + s/k) exp(-k t): no time stepping is needed, so the
    cost depends on the protocol's points, not its duration.
    """

    def __init__(self, protocol: PressureProtocol) -> None:
        plant = PressurePlant()
        self.rate_per_s = k = plant.rate_per_s
        time_s, command_pa = _within(protocol.time_s, protocol.pressure_pa, plant.min_pa, plant.max_pa)
        width_s = np.diff(time_s)
        there = width_s > 0.0
        self._start_s, width_s = time_s[:-1][there], width_s[there]
        self._command_pa = command_pa[:-1][there]
        self._slope = (command_pa[1:][there] - self._command_pa) / width_s
        # Remaining share of each segment's initial deviation at the start of the next segment.
        decay = np.exp(-k * width_s)
        self._left_pa = np.empty(len(width_s))
        pressure_pa = 0.0
        rows = zip(self._command_pa.tolist(), (self._slope / k).tolist(), width_s.tolist(), decay.tolist(), strict=True)
        for i, (command, lag, width, remains) in enumerate(rows):
            self._left_pa[i] = pressure_pa - command + lag
            pressure_pa = command + lag * k * width - lag + self._left_pa[i] * remains

    def __call__(self, time_s: ArrayLike) -> Floats:
        """Pressure (Pa) at these seconds; beyond the end the last segment continues, before the start it is 0."""
        t = np.asarray(time_s, dtype=np.float64)
        i = np.clip(np.searchsorted(self._start_s, t, side="right") - 1, 0, None)
        since_s = np.maximum(t - self._start_s[i], 0.0)
        lag_pa = self._slope[i] / self.rate_per_s
        told_pa = self._command_pa[i] + self._slope[i] * since_s
        return np.asarray(
            np.where(t < 0.0, 0.0, told_pa - lag_pa + self._left_pa[i] * np.exp(-self.rate_per_s * since_s))
        )


def _within(time_s: Floats, pressure_pa: Floats, low_pa: float, high_pa: float) -> tuple[Floats, Floats]:
    """The same line kept between two values, with a point wherever it reaches one of them."""
    if low_pa <= pressure_pa.min() and pressure_pa.max() <= high_pa:
        return time_s, pressure_pa
    times, values = [time_s], [pressure_pa]
    for limit_pa in (low_pa, high_pa):
        before, after = pressure_pa[:-1] - limit_pa, pressure_pa[1:] - limit_pa
        crosses = (before * after < 0.0) & (np.diff(time_s) > 0.0)
        share = before[crosses] / (before[crosses] - after[crosses])
        times.append(time_s[:-1][crosses] + share * np.diff(time_s)[crosses])
        values.append(np.full(int(crosses.sum()), limit_pa))
    all_s = np.concatenate(times)
    order = np.argsort(all_s, kind="stable")
    return all_s[order], np.clip(np.concatenate(values)[order], low_pa, high_pa)
