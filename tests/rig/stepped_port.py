"""SteppedPort: an emulated instrument on a serial port whose time is stepped, so that its delays are exact.

``stepped`` connects a driver to it. Everything that waits (driver, line, instrument) waits on one stepped clock: a run
with a given seed is the same on every machine, whatever its load, and minutes of it take a second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.emulate import emulator_of
from straw.rig.emulator import Emulator
from straw.rig.line import POLL_S
from straw.rig.line_controller import LineController
from straw.rig.plant import PressurePlant
from straw.rig.wire import Faults, Sent


class Time:
    """Stands in for the module ``time`` in the driver's modules."""

    def __init__(self, clock: SteppedClock) -> None:
        self.clock = clock

    def monotonic(self) -> float:
        return self.clock.monotonic_s()


@dataclass(frozen=True)
class Delays:
    """Probabilities and largest values (s) of delays: of the driver at each use of the port, and of answers."""

    driver_share: float = 0.0
    driver_s: float = 0.0
    answer_share: float = 0.0
    answer_s: float = 0.0


PROMPT = Delays()


class SteppedPort:
    """What pyserial would open: requests take their transmission time, and answers arrive in order, byte by byte.

    ``asked`` lists the requests and what was sent back. ``faults`` as those of a Wire.
    """

    def __init__(self, device: Emulator, clock: SteppedClock, faults: Faults | None, delays: Delays, seed: int) -> None:
        self.device, self.clock, self.faults, self.delays = device, clock, faults, delays
        self.asked: list[tuple[bytes, bytes]] = []
        self._random = np.random.default_rng(seed)
        self._free_s = 0.0  # when the instrument will have sent all it was asked for
        self._coming: list[tuple[float, int]] = []  # bytes and when they arrive
        self._begun = b""

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""
        self._stall()
        return self._arrived()

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes, after at most POLL_S."""
        self._stall()
        if not self._arrived():
            next_s = self._coming[0][0] if self._coming else math.inf
            self.clock.sleep(min(next_s - self.clock.monotonic_s() + 1e-9, POLL_S))
        size = min(size, self._arrived())
        got, self._coming = self._coming[:size], self._coming[size:]
        return bytes(byte for _, byte in got)

    def write(self, data: bytes) -> int:
        """The instrument receives it and sends its answers."""
        self._stall()
        byte_s, end = 10 / self.device.baud, self.device.terminator
        self._begun += data
        while end in self._begun:
            line, self._begun = self._begun.split(end, 1)
            at_s = max(self._free_s, self.clock.monotonic_s()) + byte_s * len(line + end)
            at_s += self._delay(self.delays.answer_share, self.delays.answer_s)
            if self.faults:
                sent = self.faults.answer(self.device, line + end, at_s)
            else:
                sent = Sent(self.device.answer(line + end, at_s))
            self.asked.append((line + end, sent.data))
            start_s = at_s + sent.late_s
            self._coming += [(start_s + byte_s * (k + 1), byte) for k, byte in enumerate(sent.data)]
            self._free_s = start_s + byte_s * len(sent.data)
        return len(data)

    def close(self) -> None:
        """Bytes in flight still arrive, as on a serial port that is opened again."""

    def _arrived(self) -> int:
        now_s = self.clock.monotonic_s()
        return next((k for k, (at_s, _) in enumerate(self._coming) if at_s > now_s), len(self._coming))

    def _stall(self) -> None:
        self.clock.sleep(self._delay(self.delays.driver_share, self.delays.driver_s))

    def _delay(self, share: float, most_s: float) -> float:
        return float(self._random.uniform(0.0, most_s)) if self._random.random() < share else 0.0


def stepped(
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    faults: Faults | None = None,
    delays: Delays = PROMPT,
    seed: int = 0,
    noise_pa: float = 300.0,
    timeout_s: float = 0.06,
) -> tuple[LineController, SteppedPort]:
    """A driver, not opened yet, and its port. Noise makes each answer different, so that a stale one is detected."""
    import straw.rig.controllers.alicat
    import straw.rig.controllers.ob1_mk4
    import straw.rig.line
    import straw.rig.line_controller

    clock = SteppedClock()
    for module in (
        straw.rig.line,
        straw.rig.line_controller,
        straw.rig.controllers.alicat,
        straw.rig.controllers.ob1_mk4,
    ):
        monkeypatch.setattr(module, "time", Time(clock))
    plant = PressurePlant(noise_pa=noise_pa, resolution_pa=0.0)
    port = SteppedPort(emulator_of(name)({1: plant}), clock, faults, delays, seed)
    monkeypatch.setattr("serial.serial_for_url", lambda *_, **__: port)
    controller = make_controller(name, "stepped", timeout_s=timeout_s, clock=clock)
    assert isinstance(controller, LineController)
    return controller, port
