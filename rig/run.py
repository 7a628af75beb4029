"""Run: one recording as the rest of the project sees it, in SI units and seconds since the run's zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.rig.errors import RigError
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]
CELLS = 9  # of the paper's straw, the default


@dataclass(frozen=True, eq=False)
class PressureLog:
    """Gauge pressure (Pa) against time (s since the run's zero); arrays of shape (n,), sigma NaN where unknown.

    Called with seconds it gives Pa: ``held`` (a command) keeps the last value, otherwise straight lines join samples.
    """

    time_s: Floats
    pressure_pa: Floats
    sigma_pa: Floats
    held: bool = False

    def __post_init__(self) -> None:
        if len(self.time_s) == 0 or not self.time_s.shape == self.pressure_pa.shape == self.sigma_pa.shape:
            raise RigError("PressureLog needs time_s, pressure_pa and sigma_pa of one length, at least 1")
        if not np.all(np.diff(self.time_s) > 0):
            raise RigError("PressureLog.time_s must increase strictly: sort the samples and drop repeated times first")

    def __len__(self) -> int:
        return len(self.time_s)

    def __call__(self, time_s: ArrayLike) -> Floats:
        """Pressure (Pa) at seconds since the run's zero; the first and last value outside the log."""
        t = np.asarray(time_s, dtype=np.float64)
        if not self.held:
            return np.asarray(np.interp(t, self.time_s, self.pressure_pa))
        before = np.searchsorted(self.time_s, t, side="right") - 1
        return self.pressure_pa[np.clip(before, 0, None)]


@dataclass(frozen=True)
class Event:
    """Something that happened once: arm, start, step, vent, stop, fault, ... at seconds since the run's zero."""

    time_s: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class Predicted:
    """One model's prediction in this file: tip and inside pressure, where present."""

    tip: TipTrace | None
    pressure: PressureLog | None


@dataclass(frozen=True, eq=False)
class Run:
    """One recording. ``lost`` says in plain sentences what is missing, damaged or assumed; empty when all is well.
    ``damage`` is the part of it that concerns the file itself: cut short, checksums that fail, records unreadable.

    ``zero_time_ns`` is time 0 of every log in ns since the Unix epoch. ``metadata`` is the file's ``straw.run`` with
    its ``straw.stop``, ``software`` its ``straw.software``; ``sha256`` is of the file, the name under which derived
    files know their parent.
    """

    path: Path
    sha256: str
    run_id: str
    specimen: str
    initial_deployed: tuple[int, ...] | None
    cycle: int
    cells: int
    zero_time_ns: int
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]
    command: PressureLog | None
    pressure: PressureLog | None
    tip: TipTrace | None
    predictions: Mapping[str, Predicted]
    events: tuple[Event, ...]
    lost: tuple[str, ...]
    damage: tuple[str, ...] = ()
    software: Mapping[str, str] = field(default_factory=dict)
