"""Emulation: a controller on the wire with the straw behind it, all in this process and in real time."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self

from rig.controller import controller_names
from rig.errors import RigError
from rig.plant import Plant, PressurePlant
from rig.twin import StrawStepper, Twin
from rig.wire import Device, Wire


class Emulation:
    """``with Emulation(stepper) as e:`` serves a controller at ``e.url``; ``e.twin.history`` tells what the straw did.

    ``name`` is a controller of ``rig.controllers`` that has an emulator. Each of ``addresses`` is ``"host:port"``
    (port 0 for any) or ``"pty"``; the one device answers on all of them, ``urls`` says where. The straw hangs on
    channel 1.
    """

    def __init__(
        self,
        stepper: StrawStepper,
        name: str = "ob1-mk4",
        *addresses: str,
        plant: PressurePlant | None = None,
        latency_s: float = 1e-3,
    ) -> None:
        emulator = emulator_of(name)
        self.plant = plant or PressurePlant()
        self.twin = Twin(stepper, self.plant)
        self._device = _Shared(emulator({1: self.plant}))
        self.wires: list[Wire] = []
        try:
            for address in addresses or ("127.0.0.1:0",):
                self.wires.append(Wire(self._device, address, clock=self.twin.now, latency_s=latency_s))
        except RigError:
            self._hang_up()
            raise

    @property
    def urls(self) -> tuple[str, ...]:
        """What to open, one for each address: ``socket://host:port`` or the path of the pty."""
        return tuple(wire.url for wire in self.wires)

    @property
    def url(self) -> str:
        """The first of ``urls``."""
        return self.urls[0]

    @property
    def wire(self) -> Wire:
        """The first of ``wires``."""
        return self.wires[0]

    def _hang_up(self) -> None:
        for wire in self.wires:
            wire.close()

    def __enter__(self) -> Self:
        self.twin.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._hang_up()
        self.twin.stop()


def emulator_of(name: str) -> Callable[[Mapping[int, Plant]], Device]:
    """The emulator of a controller's name; RigError with the known ones where there is none."""
    try:
        module = importlib.import_module(f"rig.emulators.{name.replace('-', '_')}")
    except ModuleNotFoundError:
        raise RigError(f"controller {name!r} has no emulator; known: {', '.join(controller_names())}") from None
    made: Callable[[Mapping[int, Plant]], Device] = module.EMULATOR
    return made


class _Shared:
    """One device on several wires: it answers one request at a time."""

    def __init__(self, device: Device) -> None:
        self.terminator, self.baud = device.terminator, device.baud
        self._device = device
        self._lock = threading.Lock()

    def answer(self, line: bytes, time_s: float) -> bytes:
        """As the device's own."""
        with self._lock:
            return self._device.answer(line, time_s)
