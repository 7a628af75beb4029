"""Emulation: a controller on the wire with the straw behind it, all in this process, in real time or faster."""

from __future__ import annotations

import importlib
import pkgutil
import threading
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import straw.rig.emulators
from straw.model.errors import ModelError
from straw.model.plugged import module_of, said
from straw.rig.clock import Clock, SteppedClock
from straw.rig.emulator import Emulator
from straw.rig.errors import RigError
from straw.rig.plant import PressurePlant
from straw.rig.twin import STEP_S, StrawStepper, Twin
from straw.rig.wire import Faults, Wire


class Emulation:
    """``with Emulation(stepper) as e:`` serves a controller at ``e.url``; ``e.twin.history`` holds what the straw did.

    ``name`` is a controller of ``straw.rig.controllers`` that has an emulator. Each of ``addresses`` is ``"host:port"``
    (port 0 for any) or ``"pty"``; the one device answers on all of them, ``urls`` says where. The straw is on
    channel 1, a closed line on each further one of ``channels``; ``device`` are the emulated instrument's own settings.
    Time is real unless ``clock`` is a SteppedClock, which the program that drives it has to share.
    """

    def __init__(
        self,
        stepper: StrawStepper,
        name: str = "ob1-mk4",
        *addresses: str,
        plant: PressurePlant | None = None,
        latency_s: float = 1e-3,
        faults: Faults | None = None,
        clock: Clock | None = None,
        step_s: float = STEP_S,
        channels: tuple[int, ...] = (1,),
        device: Mapping[str, Any] | None = None,
    ) -> None:
        emulator = emulator_of(name)
        self.plant = plant or PressurePlant()
        self.twin = Twin(stepper, self.plant, clock, step_s=step_s)
        self.clock = self.twin.clock
        plants = {**{channel: PressurePlant(seed=channel) for channel in channels}, 1: self.plant}
        try:
            self.device = emulator(plants, **(device or {}))
        except TypeError as error:
            raise RigError(f"emulated {name}: {error}; its docstring in rig/emulators names its settings") from None
        lock = threading.Lock()
        self.wires: list[Wire] = []
        try:
            for address in addresses or ("127.0.0.1:0",):
                self.wires.append(
                    Wire(
                        self.device,
                        address,
                        clock=self.clock,
                        now=self.twin.now,
                        latency_s=latency_s,
                        faults=faults,
                        lock=lock,
                    )
                )
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

    def catch_up(self) -> None:
        """Advance the straw to the present time: for a clock that does not run by itself, between two exchanges."""
        self.twin.advance_to(self.twin.now())

    def __enter__(self) -> Self:
        if not isinstance(self.clock, SteppedClock):
            self.twin.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._hang_up()
        if isinstance(self.clock, SteppedClock):
            self.catch_up()
        else:
            self.twin.stop()


GROUP = "straw.emulators"


def emulator_of(name: str) -> Callable[..., Emulator]:
    """The emulator of a controller, by its name or by a file that gives an EMULATOR; RigError where there is none."""
    if name.endswith(".py"):
        try:
            module = module_of(Path(name).resolve(), "emulator")
        except ModelError as error:
            raise RigError(str(error)) from None
        return _checked(getattr(module, "EMULATOR", None), name)
    for entry in metadata.entry_points(group=GROUP):
        if entry.name == name:
            try:
                given = entry.load()
            except Exception as error:
                raise RigError(f"emulator {name} of an installed package: {said(error)}; repair the package") from None
            return _checked(getattr(given, "EMULATOR", given), f"{name} = {entry.value}")
    try:
        own = importlib.import_module(f"straw.rig.emulators.{name.replace('-', '_')}")
    except ModuleNotFoundError:
        known = {module.name.replace("_", "-") for module in pkgutil.iter_modules(straw.rig.emulators.__path__)}
        known |= {entry.name for entry in metadata.entry_points(group=GROUP)}
        raise RigError(f"controller {name!r} has no emulator; known: {', '.join(sorted(known))}") from None
    made: Callable[..., Emulator] = own.EMULATOR
    return made


def _checked(made: object, where: str) -> Callable[..., Emulator]:
    if not callable(made):
        raise RigError(f"{where}: has no EMULATOR; a file may give CONTROLLER and EMULATOR, see rig/emulators")
    return made
