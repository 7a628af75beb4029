"""One run as input of the proposal: tip, the nominal straw's prediction, pressure and command on one even grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.replay.diagnose.propose.simulate_campaigns import played
from straw.replay.diagnose.systems.straw.observation import Observation

Floats = NDArray[np.float64]

#: Samples a second: a quarter of the camera's, and more than twice the highest frequency of `movement.BANDS_HZ`.
RATE_HZ = 60
#: Longest part of a run that is used, s.
LONGEST_S = 12.0


@dataclass(frozen=True, eq=False)
class Seen:
    """Every 1 / `RATE_HZ` from the run's beginning: tip and prediction (3, n), the gauge's reading (n,), Pa.

    ``command`` are times (s) and values (Pa) of the controller's commands, or None where not recorded.
    """

    tip: Floats
    predicted: Floats
    pressure_pa: Floats
    command: tuple[Floats, Floats] | None
    deployed: tuple[int, ...]
    cycle: int
    straw: StrawParameters

    @classmethod
    def of(
        cls,
        time_s: Floats,
        tip: Floats,
        predicted: Floats,
        pressure_pa: Floats,
        command: tuple[Floats, Floats] | None,
        deployed: Sequence[int],
        cycle: int,
        straw: StrawParameters,
    ) -> Self:
        """From samples (m,) at times that increase from about zero: means over each of the grid's intervals."""
        even_s = _grid(float(time_s[-1]))
        shown = np.stack([_means(time_s, x, even_s) for x in (*tip, *predicted, pressure_pa)])
        return cls(shown[:3], shown[3:6], shown[6], command, tuple(deployed), cycle, straw)


def observed(observation: Observation, straw: StrawParameters) -> Seen | None:
    """A run as input of the proposal, beside a straw's prediction under the measured pressure; None where the straw
    cannot follow."""
    run, table = observation.run, observation.pressure
    assert run.initial_deployed is not None
    start_s = observation.start_s
    frames_s = np.arange(0.0, min(observation.end_s - start_s, LONGEST_S) + 0.5 / RATE_HZ, 1 / 240)
    try:
        moved = table._replace(start_s=table.start_s - start_s)
        tip, _ = played(straw, moved, frames_s, run.initial_deployed, run.cycle)
    except ModelError:
        return None
    grid_s = table.start_s - start_s + table.step_s * np.arange(len(table.pressure_pa))
    even_s = _grid(float(frames_s[-1]))
    stamped_s = observation.time_s - start_s
    shown = [_means(stamped_s, x, even_s) for x in observation.tip]
    shown += [_means(frames_s, x, even_s) for x in tip]
    shown.append(np.interp(even_s, grid_s, table.pressure_pa))
    told = None if run.command is None else (run.command.time_s - start_s, run.command.pressure_pa)
    both = np.stack(shown)
    return Seen(both[:3], both[3:6], both[6], told, run.initial_deployed, run.cycle, straw)


def _grid(end_s: float) -> Floats:
    return (np.arange(max(int(min(end_s, LONGEST_S) * RATE_HZ), 2)) + 0.5) / RATE_HZ


def _means(time_s: Floats, x: Floats, even_s: Floats) -> Floats:
    """Mean of the samples in each interval of the grid; straight lines where there are none."""
    at = np.floor(time_s * RATE_HZ).astype(np.int64)
    inside = (at >= 0) & (at < len(even_s))
    count = np.bincount(at[inside], minlength=len(even_s))
    total = np.bincount(at[inside], weights=x[inside], minlength=len(even_s))
    full = count > 0
    return np.interp(even_s, even_s[full], total[full] / count[full])


__all__ = ["RATE_HZ", "Seen", "Table", "observed"]
