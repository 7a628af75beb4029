"""Controllers, emulators, and runs on them, as `straw rig run` does."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from straw.replay.api.given import GivenProtocol, GivenStraw, Named, the_protocol, the_straw
from straw.replay.api.recordings import Recording, read_recording
from straw.replay.commands.rig_run import drive, emulation, write_true_tip
from straw.replay.errors import ReplayError
from straw.replay.output import check_new
from straw.rig.clock import SteppedClock
from straw.rig.controller import Controller
from straw.rig.drivers import controller_names, make_controller
from straw.rig.emulate import Emulation
from straw.rig.guarded import GuardedController


def controllers() -> tuple[str, ...]:
    """Names of the controllers that have a driver."""
    return controller_names()


def controller(name: str, port: str, **settings: Any) -> GuardedController:
    """The pressure controller called ``name`` on a serial port or URL, held by a guardian that vents when this
    program dies: ``with straw.controller("ob1-mk4", port) as c: c.set_pressure(1, -5e3)``.

    ``settings``: ``channels`` (1,), ``limits`` (PressureLimits, Pa), ``heartbeat_s``, and the driver's own. Leaving the
    block vents. Raises RigError for what cannot be opened.
    """
    return GuardedController(name, port, **settings)


def emulated(
    straw: GivenStraw = None, deployed: Collection[int] = (), controller: str = "ob1-mk4", **settings: Any
) -> Emulation:
    """A controller on the wire with the straw behind it: ``with straw.emulated(deployed=[1, 4]) as e:`` serves at
    ``e.url``; ``e.twin.history`` is the straw's motion."""
    return emulation(the_straw(straw), deployed, controller, **settings)


def run_protocol(
    protocol: GivenProtocol,
    output: Named,
    controller: Controller | None = None,
    *,
    emulate: bool = False,
    fast: bool = True,
    straw: GivenStraw = None,
    rate_hz: float = 100.0,
    metadata: Mapping[str, str] | None = None,
    tip: Named | None = None,
) -> Recording:
    """Drive a protocol, record it in ``output`` and return the recording.

    On ``controller`` (not opened yet), or with ``emulate`` on an emulated OB1 MK4 with ``straw`` behind it, in real
    time, or as ``fast`` as possible. ``rate_hz``: readings a second. ``metadata`` is recorded. ``tip``: where, with
    ``emulate``, the track of a perfect camera is written; it is joined to the recording. Vents at the end,
    and on any error or signal; raises RigError.
    """
    the, what, path = the_straw(straw), the_protocol(protocol), Path(output)
    check_new(path)
    about: dict[str, Any] = {**(metadata or {}), **the.laws}

    def work(driver: Controller) -> Recording:
        return read_recording(drive(driver, what, path, the.cells, rate_hz, **about).path)

    if (controller is None) != emulate or (tip is not None and not emulate):
        raise ReplayError("run_protocol: give a controller, or emulate=True, not both; tip needs emulate=True")
    if controller is not None:
        return work(controller)
    if tip is not None:
        check_new(Path(tip))
    clock = SteppedClock() if fast else None
    with emulation(the, what.initial_deployed, "ob1-mk4", clock=clock) as there:
        driver = (
            make_controller("ob1-mk4", there.url, clock=clock)
            if clock
            else GuardedController("ob1-mk4", there.url, remembered=False)
        )
        recorded = work(driver)
    if tip is None:
        return recorded
    write_true_tip(Path(tip), recorded, there.twin.history)
    return read_recording(path, tip)
