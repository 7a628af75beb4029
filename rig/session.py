"""Session: runs a protocol on a controller and records it; however it ends, it vents first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from straw.rig.controller import Controller
from straw.rig.errors import RigError
from straw.rig.interrupts import Interrupts
from straw.rig.operator import Operator
from straw.rig.protocol import PressureProtocol
from straw.rig.session_run import Outcome, Progress, SessionRun

__all__ = ["Outcome", "Progress", "run_protocol"]


def run_protocol(
    controller: Controller,
    protocol: PressureProtocol,
    path: str | Path,
    *,
    rate_hz: float = 100.0,
    metadata: Mapping[str, str] | None = None,
    progress: Progress | None = None,
    led: bool = False,
    operator: Operator | None = None,
) -> Outcome:
    """Drive an opened controller through the protocol, read every cycle, and record all of it in ``path`` (MCAP).

    Time 0 of the recording is the start of the protocol's main part. ``metadata`` joins the record ``straw.run``.
    ``led`` blinks a coded burst on the trigger output before and after, for the camera's clock (see rig/led.py).
    ``operator`` may hold and end the run from another thread.
    Limits in force are those of the protocol and of the controller together, and every point is checked before
    anything moves. On the normal end, an error, Ctrl-C (KeyboardInterrupt), or SIGTERM (SystemExit) the straw is
    vented first, then the file is finished with the reason in it; a second Ctrl-C changes nothing about that.
    """
    if not controller.is_open:
        raise RigError(f"controller {controller.name} is not open; write: with controller: run_protocol(...)")
    for part in protocol.parts:
        part.check_limits(controller.limits.and_also(protocol.limits))
        if part.channel not in controller.channels:
            raise RigError(f"protocol {protocol.name} wants channel {part.channel}, in use: {controller.channels}")
    if not 0.0 < rate_hz <= 1000.0:
        raise RigError(f"loop rate {rate_hz:g} Hz must be above 0 and at most 1000")
    with controller.narrowed(protocol.limits), Interrupts("interrupted: venting first") as interrupts:
        session = SessionRun(
            controller, protocol, Path(path), rate_hz, metadata or {}, progress, interrupts, led, operator or Operator()
        )
        outcome = session.run()
        interrupts.check()  # a signal that came during the last vent still counts
        return outcome
