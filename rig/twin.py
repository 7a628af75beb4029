"""Twin: the straw behind the wire. Outlet pressure in, straw motion and volume out, in step with a clock."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from straw.rig.clock import Clock
from straw.rig.plant import PressurePlant

Floats = NDArray[np.float64]
STEP_S = 1e-3  # default step of the history, within which the outlet pressure is linear
TICK_S = 5e-3  # how long the twin's thread sleeps, and how far it stays behind the clock


class StrawStepper(Protocol):
    """A straw that can be advanced in time; ``straw.model.simulate.Stepper`` is one."""

    @property
    def time_s(self) -> float:
        """Time reached (s)."""

    @property
    def tip(self) -> tuple[float, float, float]:
        """Tip (x_m, z_m, phi_rad)."""

    @property
    def volume_m3(self) -> float:
        """Inner volume (m^3)."""

    @property
    def pressure_pa(self) -> float:
        """Gauge pressure inside (Pa)."""

    def advance(self, time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        """Advance to ``time_s`` under an outlet pressure that varies linearly on the way."""


@dataclass(frozen=True, eq=False)
class TwinHistory:
    """The straw's true motion: arrays of shape (n,), SI units, times since the twin's zero.

    ``zero_wall_ns`` is that zero in ns since the Unix epoch; ``external_pa`` is at the outlet, ``pressure_pa`` inside.
    """

    zero_wall_ns: int
    time_s: Floats
    external_pa: Floats
    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    pressure_pa: Floats
    volume_m3: Floats


class Twin:
    """Moves ``stepper`` in real time under the pressure of ``plant``; keeps the last ``remember_s`` seconds.

    Give ``twin.now`` to the wire as its clock: wire, plant and straw then share one time, zero at construction. The
    straw runs a tick behind and catches up when late, so a slow model never delays an answer on the wire.
    """

    def __init__(
        self,
        stepper: StrawStepper,
        plant: PressurePlant,
        clock: Clock | None = None,
        remember_s: float = 300.0,
        step_s: float = STEP_S,
    ) -> None:
        self.stepper = stepper
        self.plant = plant
        self.step_s = step_s
        # One step before the clock starts, so that the model is compiled before any answer is due.
        pressure_pa = plant.pressure(stepper.time_s)
        stepper.advance(stepper.time_s + step_s, pressure_pa, pressure_pa)
        # An emulator may run for days: its history must not grow without bound.
        self._rows: deque[tuple[float, ...]] = deque(maxlen=round(remember_s / step_s))
        self._remember(pressure_pa)
        self.clock = clock or Clock()
        self._zero_ns = self.clock.monotonic_ns() - round(stepper.time_s * 1e9)
        self.zero_wall_ns = self.clock.wall_ns(self._zero_ns)
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def now(self) -> float:
        """Seconds since the twin's zero."""
        return (self.clock.monotonic_ns() - self._zero_ns) * 1e-9

    def advance_to(self, time_s: float) -> None:
        """Advance the straw in whole steps, up to ``time_s``; only one thread may do so."""
        while (end_s := self.stepper.time_s + self.step_s) <= time_s:
            start_s = self.stepper.time_s
            external_pa, before_m3 = self.plant.pressure(end_s), self.stepper.volume_m3
            self.stepper.advance(end_s, self.plant.pressure(start_s), external_pa)
            self.plant.take(end_s, self.stepper.volume_m3 - before_m3, self.step_s)
            self._remember(external_pa)

    def start(self) -> None:
        """Follow the clock from a daemon thread."""
        self._thread = threading.Thread(target=self._follow, name="twin", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Catch up with the clock and stop; an error of the straw model is raised here."""
        if self._thread is not None:
            self._stopping.set()
            self._thread.join()
            self._thread = None
        if self._failure is not None:
            raise self._failure

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.stop()

    @property
    def history(self) -> TwinHistory:
        """The history, one row a step."""
        columns = np.array(self._rows, dtype=np.float64).T
        return TwinHistory(self.zero_wall_ns, *columns)

    def _remember(self, external_pa: float) -> None:
        s = self.stepper
        self._rows.append((s.time_s, external_pa, *s.tip, s.pressure_pa, s.volume_m3))

    def _follow(self) -> None:
        try:
            while not self._stopping.wait(TICK_S):
                # Staying a tick behind avoids commands that are still arriving.
                self.advance_to(self.now() - TICK_S)
            self.advance_to(self.now())
        except BaseException as error:  # raised by stop(), as a thread cannot raise to its caller
            self._failure = error
