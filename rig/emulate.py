"""Emulation: a controller on the wire with the straw behind it, all in this process and in real time."""

from __future__ import annotations

import importlib
from types import TracebackType
from typing import Self

from rig.controller import controller_names
from rig.errors import RigError
from rig.plant import PressurePlant
from rig.twin import StrawStepper, Twin
from rig.wire import Wire


class Emulation:
    """``with Emulation(stepper) as e:`` serves a controller at ``e.url``; ``e.twin.history`` tells what the straw did.

    ``name`` is a controller of ``rig.controllers`` that has an emulator; ``address`` is ``"host:port"`` (port 0 for
    any) or ``"pty"``. The straw hangs on channel 1.
    """

    def __init__(
        self,
        stepper: StrawStepper,
        name: str = "ob1-mk4",
        address: str = "127.0.0.1:0",
        *,
        plant: PressurePlant | None = None,
        latency_s: float = 1e-3,
    ) -> None:
        self.plant = plant or PressurePlant()
        try:
            module = importlib.import_module(f"rig.emulators.{name.replace('-', '_')}")
        except ModuleNotFoundError:
            raise RigError(f"controller {name!r} has no emulator; known: {', '.join(controller_names())}") from None
        self.twin = Twin(stepper, self.plant)
        self.wire = Wire(module.EMULATOR({1: self.plant}), address, clock=self.twin.now, latency_s=latency_s)

    @property
    def url(self) -> str:
        """What to open: ``socket://host:port`` or the path of the pty."""
        return self.wire.url

    def __enter__(self) -> Self:
        self.twin.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.wire.close()
        self.twin.stop()
