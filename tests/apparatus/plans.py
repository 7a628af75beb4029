"""The eight runs of a campaign as commanded, and a regulator's response to the commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Plan:
    """One run: commands as (s, Pa), cells deployed at its start, cycles before it, its length."""

    run_id: str
    commands: tuple[tuple[float, float], ...]
    deployed: tuple[int, ...]
    cycle: int
    seconds: float


def step(run_id: str, kpa: float, deployed: tuple[int, ...], cycle: int, seconds: float) -> Plan:
    """A run whose pressure steps to one value a quarter of a second after its start."""
    return Plan(run_id, ((0.0, 0.0), (0.25, 1e3 * kpa)), deployed, cycle, seconds)


WITHOUT_1_4 = (2, 3, 5, 6, 7, 8, 9)
STAIRS = (0.0, -4.0, -8.0, -4.0, 4.0, 10.0, 4.0, -6.0, 0.0)
PULSES = ((0.0, 0.0), (0.2, 12e3), (0.5, -9e3), (0.8, 12e3), (1.1, 0.0), (1.6, 18e3), (2.4, -10e3), (3.2, 0.0))
PLANS = (  # in the order in which they are made
    step("fold-25kPa", -25, (1, 4), 0, 4.0),
    step("deploy-35kPa-1", 35, WITHOUT_1_4, 1, 4.0),
    step("fold-20kPa-2-5", -20, (2, 5), 1, 4.5),
    step("deploy-35kPa-2", 35, WITHOUT_1_4, 2, 4.0),
    Plan("staircase", tuple((max(0.0, 0.5 * i - 0.25), 1e3 * p) for i, p in enumerate(STAIRS)), (1, 3, 6), 2, 4.5),
    step("deploy-35kPa-3", 35, WITHOUT_1_4, 3, 4.0),
    Plan("pulses", PULSES, (1, 2, 3, 4, 5, 6, 7, 8, 9), 3, 4.0),
    step("deploy-30kPa-6", 30, (1, 2, 3, 4, 5, 7, 8, 9), 4, 3.5),
)
RUN_IDS = tuple(plan.run_id for plan in PLANS)


def regulated(plan: Plan, time_s: np.ndarray, settling_s: float) -> np.ndarray:
    """The regulator's response to the commands (Pa): it settles within tens of ms."""
    pressure, before = np.zeros_like(time_s), 0.0
    for start, command in plan.commands:
        after = np.clip(time_s - start, 0.0, None)
        pressure += (command - before) * (1.0 - np.exp(-after / settling_s))
        before = command
    return pressure
