"""PressurePlant: how the outlet pressure follows the controller's command; time is an argument, never a clock."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Protocol

import numpy as np


class Plant(Protocol):
    """The interface of what is behind an emulated controller; times in s, gauge pressures in Pa."""

    def command(self, time_s: float, pressure_pa: float) -> None:
        """Command a pressure from this time on."""

    def reading(self, time_s: float) -> float:
        """The reading of the controller's own sensor."""

    def flow(self, time_s: float) -> float:
        """The reading of a flow sensor in the line, m^3/s into the straw."""

    def hold(self, time_s: float, closed: bool) -> None:
        """Close the valves, or let them follow the command again."""


REMEMBERED = 10_000  # commands, at the least
AMBIENT_PA = 101_325.0


class PressurePlant:
    """First-order response dP/dt = rate (P_set - P) - leak P, with its sensor.

    ``rate_per_s`` 50 reaches 97 % of a step after 70 ms, as the paper measured; ``leak_per_s`` is the line's leak:
    a droop while the controller regulates, a decay while its valves are held closed. ``min_pa``, ``max_pa`` are the
    supply, to which commands are clipped. The reading adds white noise ``noise_pa`` and rounds to
    ``resolution_pa``; equal seeds give equal noise. ``air_m3`` is the air between controller and water, which
    the straw's change of volume expands or compresses. Recent commands are kept, so that the pressure of a past time
    can be computed and a slow straw model never delays the wire.
    """

    def __init__(
        self,
        *,
        rate_per_s: float = 50.0,
        leak_per_s: float = 0.0,
        noise_pa: float = 30.0,
        resolution_pa: float = 100.0,
        min_pa: float = -90e3,
        max_pa: float = 100e3,
        air_m3: float = math.inf,
        seed: int = 0,
    ) -> None:
        self.rate_per_s = rate_per_s
        self.leak_per_s = leak_per_s
        self.noise_pa = noise_pa
        self.resolution_pa = resolution_pa
        self.min_pa = min_pa
        self.max_pa = max_pa
        self.air_m3 = air_m3
        self._random = np.random.default_rng(seed)
        # (from s, pressure then, pressure aimed at, how fast in 1/s), oldest first
        self._segments = [(-math.inf, 0.0, 0.0, rate_per_s)]
        self._told_pa, self._closed = 0.0, False
        self._volume = (-math.inf, 0.0, 0.0)  # (at s, pressure it left behind, flow in m^3/s)

    def command(self, time_s: float, pressure_pa: float) -> None:
        """Aim at a pressure (Pa) from ``time_s`` on; times must not decrease."""
        self._told_pa = min(max(pressure_pa, self.min_pa), self.max_pa)
        self._turn(time_s)

    def hold(self, time_s: float, closed: bool) -> None:
        """Close the valves from ``time_s`` on, so that only the leak remains, or reopen them to the last command."""
        self._closed = closed
        self._turn(time_s)

    def pressure(self, time_s: float) -> float:
        """True outlet pressure (Pa), exact for any time up to the next command or volume."""
        start_s, start_pa, aim_pa, rate = self._segments[bisect_right(self._segments, time_s, key=lambda s: s[0]) - 1]
        regulated = aim_pa if start_pa == aim_pa else aim_pa + (start_pa - aim_pa) * math.exp(rate * (start_s - time_s))
        at_s, left_pa, _ = self._volume
        return regulated + left_pa * math.exp(rate * min(at_s - time_s, 0.0)) if left_pa else regulated

    def reading(self, time_s: float) -> float:
        """The sensor's value (Pa): noise, then resolution."""
        noisy = self.pressure(time_s) + self.noise_pa * self._random.standard_normal()
        return float(round(noisy / self.resolution_pa) * self.resolution_pa) if self.resolution_pa else float(noisy)

    def flow(self, time_s: float) -> float:
        """Flow into the straw (m^3/s), as last given to ``take``."""
        return self._volume[2]

    def take(self, time_s: float, volume_m3: float, during_s: float) -> None:
        """The straw took this much in, in the ``during_s`` before ``time_s``: the air in the line expands or is
        compressed."""
        at_s, left_pa, _ = self._volume
        rate = self._segments[-1][3]
        left_pa = left_pa * math.exp(rate * (at_s - time_s)) if left_pa else 0.0
        left_pa -= (AMBIENT_PA + self.pressure(time_s)) * volume_m3 / self.air_m3
        self._volume = (time_s, left_pa, volume_m3 / during_s)

    def _turn(self, time_s: float) -> None:
        if len(self._segments) > 2 * REMEMBERED:
            del self._segments[:REMEMBERED]
        start_s, start_pa, aim_pa, rate = self._segments[-1]
        if start_pa != aim_pa:
            start_pa = aim_pa + (start_pa - aim_pa) * math.exp(rate * (start_s - time_s))
        rate = (0.0 if self._closed else self.rate_per_s) + self.leak_per_s
        aim_pa = self._told_pa * (1.0 - self.leak_per_s / rate) if rate else start_pa
        self._segments.append((time_s, start_pa, aim_pa, rate))
