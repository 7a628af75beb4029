"""PressurePlant: how the outlet pressure follows the controller's command; time is an argument, never a clock."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Protocol

import numpy as np


class Plant(Protocol):
    """What an emulated controller needs to know about the world behind it; times in s, gauge pressures in Pa."""

    def command(self, time_s: float, pressure_pa: float) -> None:
        """Ask for a pressure from this time on."""

    def reading(self, time_s: float) -> float:
        """What the controller's own sensor shows."""


REMEMBERED = 10_000  # commands, at the least


class PressurePlant:
    """First-order response dP/dt = rate (P_set - P), with the sensor that watches it.

    ``rate_per_s`` 50 reaches 97 % of a step after 70 ms, as the paper measured. ``min_pa``, ``max_pa`` are the supply:
    a command beyond them is answered by them. The reading adds white noise ``noise_pa`` and rounds to
    ``resolution_pa``; equal seeds give equal noise. The last commands are kept, so the pressure of a past time can be
    asked: a slow straw model behind it never makes the wire wait.
    """

    def __init__(
        self,
        *,
        rate_per_s: float = 50.0,
        noise_pa: float = 30.0,
        resolution_pa: float = 100.0,
        min_pa: float = -90e3,
        max_pa: float = 100e3,
        seed: int = 0,
    ) -> None:
        self.rate_per_s = rate_per_s
        self.noise_pa = noise_pa
        self.resolution_pa = resolution_pa
        self.min_pa = min_pa
        self.max_pa = max_pa
        self._random = np.random.default_rng(seed)
        self._segments = [(-math.inf, 0.0, 0.0)]  # (from s, pressure then, pressure aimed at), oldest first

    def command(self, time_s: float, pressure_pa: float) -> None:
        """Aim at a pressure (Pa) from ``time_s`` on; times must not decrease."""
        if len(self._segments) > 2 * REMEMBERED:
            del self._segments[:REMEMBERED]
        self._segments.append((time_s, self.pressure(time_s), min(max(pressure_pa, self.min_pa), self.max_pa)))

    def pressure(self, time_s: float) -> float:
        """True outlet pressure (Pa), exact for any time up to the next command."""
        start_s, start_pa, aim_pa = self._segments[bisect_right(self._segments, time_s, key=lambda s: s[0]) - 1]
        if start_pa == aim_pa:
            return aim_pa
        return aim_pa + (start_pa - aim_pa) * math.exp(-self.rate_per_s * (time_s - start_s))

    def reading(self, time_s: float) -> float:
        """The sensor's value (Pa): noise, then resolution."""
        noisy = self.pressure(time_s) + self.noise_pa * self._random.standard_normal()
        return float(round(noisy / self.resolution_pa) * self.resolution_pa) if self.resolution_pa else float(noisy)
