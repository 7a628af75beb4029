"""Protocols of training campaigns: the eight of a usual campaign, and random ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: How close together commands of a ramp are, s.
RAMP_STEP_S = 0.02


@dataclass(frozen=True)
class Protocol:
    """One run: commands as (s, Pa), cells deployed at its start, cycles before it, its length."""

    commands: tuple[tuple[float, float], ...]
    deployed: tuple[int, ...]
    cycle: int
    seconds: float

    def regulated(self, time_s: Floats, settling_s: float) -> Floats:
        """Pressure (Pa) at times (n,), each command neared exponentially."""
        out, before = np.zeros_like(time_s), 0.0
        for start_s, command_pa in self.commands:
            out += (command_pa - before) * -np.expm1(-np.clip(time_s - start_s, 0.0, None) / settling_s)
            before = command_pa
        return out


def _step(kpa: float, deployed: tuple[int, ...], cycle: int, seconds: float) -> Protocol:
    return Protocol(((0.0, 0.0), (0.25, 1e3 * kpa)), deployed, cycle, seconds)


#: Levels of the given staircase, kPa, half a second each.
_STAIRS = (0.0, -4.0, -8.0, -4.0, 4.0, 10.0, 4.0, -6.0, 0.0)
#: Times (s) and pressures (Pa) of the given pulses.
_PULSES = ((0.0, 0.0), (0.2, 12e3), (0.5, -9e3), (0.8, 12e3), (1.1, 0.0), (1.6, 18e3), (2.4, -10e3), (3.2, 0.0))
#: Cells deployed at the beginning of the given runs that deploy the others.
_BUT_1_4 = (2, 3, 5, 6, 7, 8, 9)
#: The runs of the recordings the project was given (../shared/recordings).
USUAL = (
    _step(-25, (1, 4), 0, 4.0),
    _step(35, _BUT_1_4, 1, 4.0),
    _step(-20, (2, 5), 1, 4.5),
    _step(35, _BUT_1_4, 2, 4.0),
    Protocol(tuple((max(0.0, 0.5 * i - 0.25), 1e3 * p) for i, p in enumerate(_STAIRS)), (1, 3, 6), 2, 4.5),
    _step(35, _BUT_1_4, 3, 4.0),
    Protocol(_PULSES, tuple(range(1, 10)), 3, 4.0),
    _step(30, (1, 2, 3, 4, 5, 7, 8, 9), 4, 3.5),
)


def drawn(rng: np.random.Generator, cells: int) -> tuple[Protocol, ...]:
    """Random protocols of one campaign: two to eight runs of 3 to 8 s, cycles rising."""
    cycle, out = int(rng.integers(3)), []
    for _ in range(int(rng.integers(2, 9))):
        out.append(_one(rng, cells, cycle))
        cycle += int(rng.integers(3))
    return tuple(out)


def _one(rng: np.random.Generator, cells: int, cycle: int) -> Protocol:
    """A random run: steps up or down, holds below the snap pressure, ramps, staircases, pulses."""
    kind = rng.choice(["up", "down", "hold", "ramp", "stairs", "pulses"], p=[0.3, 0.2, 0.12, 0.12, 0.13, 0.13])
    seconds = float(rng.uniform(3.0, 5.0) if rng.random() < 0.85 else rng.uniform(5.0, 8.0))
    start_s = float(rng.uniform(0.15, 0.5))
    few = tuple(sorted(int(c) for c in rng.choice(cells, int(rng.choice([1, 2, 3, 4])), replace=False) + 1))
    most = tuple(c for c in range(1, cells + 1) if c not in few)
    up = bool(rng.random() < 0.6)
    if kind == "up":
        commands = [(0.0, 0.0), (start_s, rng.uniform(22e3, 40e3))]
        if rng.random() < 0.3:
            commands.append((seconds * rng.uniform(0.5, 0.8), rng.uniform(0.0, 10e3)))
        deployed = most if rng.random() < 0.85 else ()
    elif kind == "down":
        commands = [(0.0, 0.0), (start_s, -rng.uniform(12e3, 30e3))]
        if rng.random() < 0.3:
            commands.append((seconds * rng.uniform(0.5, 0.8), -rng.uniform(0.0, 6e3)))
        deployed = few if rng.random() < 0.85 else most
    elif kind == "hold":
        commands = [(0.0, 0.0), (start_s, rng.uniform(15e3, 23e3) if up else -rng.uniform(7e3, 12.5e3))]
        deployed = most if up else few
    elif kind == "ramp":
        top = rng.uniform(20e3, 40e3) if up else -rng.uniform(12e3, 25e3)
        last_s = start_s + rng.uniform(0.3, 0.8) * (seconds - start_s)
        at = np.arange(start_s, last_s, RAMP_STEP_S)
        commands = [(0.0, 0.0), *((float(t), float(top * (t - start_s) / (last_s - start_s))) for t in at)]
        deployed = most if up else few
    else:
        levels = int(rng.integers(4, 10))
        high, low = (12e3, -9e3) if kind == "stairs" else (rng.uniform(10e3, 35e3), -rng.uniform(6e3, 20e3))
        every_s = rng.uniform(0.7, 1.3, levels)
        at = start_s + np.cumsum(every_s) * (seconds - start_s) / every_s.sum() * rng.uniform(0.75, 0.98)
        commands = [(0.0, 0.0), *((float(t), float(rng.uniform(low, high))) for t in at - at[0] + start_s)]
        deployed = (few, most, tuple(range(1, cells + 1)), ())[rng.choice(4, p=[0.4, 0.4, 0.1, 0.1])]
    return Protocol(tuple((float(t), float(p)) for t, p in commands), deployed, cycle, seconds)
