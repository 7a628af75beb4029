"""Vents an instrument, or only reads it, whatever drove it last and however that ended."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.errors import LinkLostError, RigError
from straw.rig.ports import Known, is_guarded
from straw.rig.reading import Reading

END_S = 6.0  # the guardian's own vent, or its standby's if it hangs
SETTLE_S = 2.0  # the paper's controller reaches 97 % of a step after 0.07 s; tubes and a tank may be slower
AMBIENT_PA = 1e3  # gauge; within the offset of an uncalibrated regulator


@dataclass(frozen=True)
class Vented:
    """One instrument after the vent: whether it confirmed, its readings (Pa gauge by channel), the guardian that was
    ended.

    ``is_there`` is False where the port does not open; ``problem`` is empty when all is well.
    """

    port: str
    controller: str
    is_there: bool
    confirmed: bool
    pressure_pa: Mapping[int, float]
    ended_guardian: int = 0
    problem: str = ""

    @property
    def is_empty(self) -> bool:
        """Whether the vent was confirmed and the pressure is gone."""
        return self.confirmed and not self.problem


def vent_known(known: Known) -> Vented:
    """Vent the instrument on a port. A run that is being driven through it is ended first, by way of its guardian."""
    ended = known.guardian_pid if is_guarded(known) else 0
    if ended:
        _end(known)
    try:
        controller = make_controller(known.controller, known.port, **known.settings)
        controller.open()  # which vents
    except RigError as error:
        is_there = not isinstance(error, LinkLostError)
        return Vented(known.port, known.controller, is_there, False, {}, ended, str(error))
    problem, pressure_pa = "", {}
    try:
        pressure_pa = _settled(controller)
        if pressures := [f"{p / 1e3:.1f} kPa" for p in pressure_pa.values() if abs(p) > AMBIENT_PA]:
            problem = f"confirmed the vent but reads {', '.join(pressures)}: open a valve by hand, check the tubes"
    except RigError as error:
        problem = f"confirmed the vent but cannot be read: {error}"
    finally:
        with suppress(RigError):  # it was confirmed already
            controller.close()
    return Vented(known.port, known.controller, True, True, pressure_pa, ended, problem)


def look(known: Known) -> tuple[tuple[Reading, ...], dict[str, str]]:
    """The readings of every channel and the instrument's own description; nothing is set, vented or changed."""
    if is_guarded(known):
        raise RigError(
            f"port {known.port} is held by guardian {known.guardian_pid}, which drives a run; see its page or "
            f"recording, or end it with: straw rig vent --port {known.port}"
        )
    with make_controller(known.controller, known.port, **known.settings).looking() as controller:
        return controller.read(), controller.snapshot()


def _settled(controller: Controller) -> dict[int, float]:
    """Pressure by channel (Pa), as soon as it is gone or after ``SETTLE_S``."""
    until_s = time.monotonic() + SETTLE_S
    while True:
        try:
            pressure_pa = {reading.channel: reading.pressure_pa for reading in controller.read()}
        except RigError:
            if time.monotonic() > until_s:
                raise
            continue
        if time.monotonic() > until_s or all(abs(p) <= AMBIENT_PA for p in pressure_pa.values()):
            return pressure_pa
        time.sleep(0.02)


def _end(known: Known) -> None:
    """Make a guardian vent and end, and wait until it has released the port."""
    with suppress(OSError):
        os.kill(known.guardian_pid, signal.SIGTERM)
    until_s = time.monotonic() + END_S
    while is_guarded(known) and time.monotonic() < until_s:
        time.sleep(0.02)
