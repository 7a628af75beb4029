"""One run of a protocol: arm, loop, vent, and the finished recording of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from straw.rig.controller import Controller
from straw.rig.errors import RigError
from straw.rig.interrupts import Interrupts
from straw.rig.led import BURST_S, blink
from straw.rig.operator import Operator, StoppedError
from straw.rig.patience import Patience
from straw.rig.protocol import PressureProtocol
from straw.rig.run import CELLS
from straw.rig.run_write import RunWriter

ARM_S = 0.2  # between writing the file's head, which names the run's zero, and the start
BEAT_S = 0.5  # a long wait between two samples must not count as silence
Progress = Callable[[float, float, float], None]  # (time s, duration s, measured Pa)


@dataclass(frozen=True)
class Outcome:
    """Result of a run: the finished recording, cycles done, the loop rate reached (Hz) and the readings that failed.

    ``stopped`` says who ended it before the protocol did; otherwise empty.
    """

    path: Path
    cycles: int
    rate_hz: float
    missed: int
    stopped: str = ""


class SessionRun:
    """One run: its writer, its counters, and the loop."""

    def __init__(
        self,
        controller: Controller,
        protocol: PressureProtocol,
        path: Path,
        rate_hz: float,
        metadata: Mapping[str, str],
        progress: Progress | None,
        interrupts: Interrupts,
        led: bool,
        operator: Operator,
    ) -> None:
        self.controller = controller
        self.protocol = protocol
        self.period_s = 1.0 / rate_hz
        self.progress = progress
        self.interrupts = interrupts
        self.led = led
        self.operator = operator
        self.stopped = ""
        self.told_pa: dict[int, float] = {}  # by channel, as acknowledged
        self.measured_pa = 0.0
        self.steps_s = {part.channel: list(part.steps_s) for part in protocol.parts}
        self.cycles, self.patience = 0, Patience()
        self.run_s = 0.0
        self.start_ns = controller.clock.monotonic_ns() + round((ARM_S + BURST_S * led) * 1e9)
        wall_start_ns = controller.clock.wall_ns(self.start_ns)
        self.writer = RunWriter(
            path,
            {
                "run_id": path.stem,
                "cells": str(CELLS),
                **protocol.metadata,
                "rate_hz": f"{rate_hz:g}",
                **controller.snapshot(),
                **metadata,
                "zero_time_ns": str(wall_start_ns + round(protocol.zero_s * 1e9)),
            },
            {"protocol.toml": protocol.text.encode()} if protocol.text else {},
        )
        controller.record_in(path.with_name(path.name + ".guardian"))

    def run(self) -> Outcome:
        """Arm, loop, and vent in any case; errors are raised after the file is finished."""
        status, reason = "fail", "unknown"
        try:
            self.event("arm", f"limits {self.controller.limits}")
            self.controller.vent()
            self.burst()
            self.loop()
            if self.led:
                self.controller.vent()
                self.burst()
            status, reason = "success", "the protocol ended"
        except RigError as error:
            reason = str(error)
            raise RigError(f"{error}; what was recorded is kept in {self.writer.kept}") from None
        except StoppedError as stop:
            status, reason = "abort", str(stop)
            self.stopped = reason
        except (KeyboardInterrupt, SystemExit) as stop:
            status, reason = "abort", "Ctrl-C" if isinstance(stop, KeyboardInterrupt) else "the program was told to end"
            raise
        except BaseException as error:
            reason = f"{type(error).__name__}: {error}"
            raise
        finally:
            self.vent_and_finish(status, reason)
        rate_hz = self.cycles / self.run_s if self.run_s else 0.0
        return Outcome(self.writer.path, self.cycles, rate_hz, self.patience.missed, self.stopped)

    def loop(self) -> None:
        """Command when the table changes, read and log every cycle, until the protocol's end."""
        duration_s = self.protocol.duration_s
        self.patience.answered()
        self.wait_until(0.0)
        self.event("start", self.protocol.name)
        now_s = due_s = self.now_s()
        while (protocol_s := self.operator.protocol_s(now_s)) < duration_s:
            self.interrupts.check()
            for kind, text in self.operator.said():
                self.event(kind, text)
            try:
                self.command(protocol_s)
                self.listen()
                self.patience.answered()
            except RigError as error:
                if self.writer.failed:
                    raise
                self.patience.failed(error)
                self.event("fault", str(error))  # recorded, but it does not end the run
            self.cycles += 1
            self.run_s = self.now_s()
            if self.progress:
                self.progress(min(protocol_s, duration_s), duration_s, self.measured_pa)
            due_s = max(due_s + self.period_s, self.run_s)  # a late cycle is not followed by a burst
            self.wait_until(due_s)
            now_s = self.now_s()
        self.event("stop", "end of protocol")

    def command(self, protocol_s: float) -> None:
        """Command each channel its table's value, where that differs from the last command."""
        for part in self.protocol.parts:
            channel, wanted_pa = part.channel, float(part(protocol_s))
            if self.controller.rounded(wanted_pa) == self.told_pa.get(channel):
                continue
            # until it is acknowledged; otherwise the next cycle commands the value then due
            self.told_pa.pop(channel, None)
            command = self.controller.set_pressure(channel, wanted_pa)
            self.told_pa[channel] = command.pressure_pa
            self.writer.command(command)
            steps = self.steps_s[channel]
            if steps and steps[0] <= protocol_s:
                self.steps_s[channel] = [step_s for step_s in steps if step_s > protocol_s]
                which = "" if part is self.protocol else f"channel {channel} "
                self.event("step", f"{which}to {command.pressure_pa:g} Pa", command.wall_ns)

    def listen(self) -> None:
        """Read every channel in use."""
        readings = self.controller.read()
        for reading in readings:
            self.writer.reading(reading)
            if reading.channel == self.protocol.channel:
                self.measured_pa = reading.pressure_pa
        self.operator.heard(self.now_s(), readings, self.told_pa)

    def vent_and_finish(self, status: str, reason: str) -> None:
        """Vent first, then record the outcome, then finish the file."""
        vent_error: RigError | None = None
        try:
            self.controller.vent()
        except BaseException as error:  # a failed vent must be recorded in any case
            vent_error = (
                error if isinstance(error, RigError) else RigError(f"vent failed: {type(error).__name__} {error}")
            )
        try:
            self.event("vent", str(vent_error) if vent_error else "confirmed by the controller")
            if status != "success":
                self.event("abort" if status == "abort" else "fail", reason)
        finally:
            closing = {
                "exit_status": status if vent_error is None else "fail",
                "exit_reason": reason,
                "vent": "not confirmed" if vent_error else "confirmed",
                "cycles": str(self.cycles),
                "missed_readings": str(self.patience.missed),
            }
            try:
                self.writer.finish(closing)
            except RigError as error:  # a full disk
                kept = self.writer.kept
                raise RigError(
                    f"{error}; vent {closing['vent']}; what was recorded is kept in {kept}: straw runs recover {kept}"
                ) from None
        if vent_error is not None:
            raise RigError(f"{vent_error} ({reason}); what was recorded is kept in {self.writer.kept}")

    def now_s(self) -> float:
        """Seconds since the start."""
        return (self.controller.clock.monotonic_ns() - self.start_ns) * 1e-9

    def wait_until(self, time_s: float) -> None:
        """Sleep until then; meanwhile send heartbeats to the guardian and take the operator's orders."""
        while (left_s := time_s - self.now_s()) > BEAT_S:
            self.controller.clock.sleep(BEAT_S)
            self.controller.beat()
            self.interrupts.check()
            self.operator.check()
        self.controller.clock.sleep(left_s)

    def burst(self) -> None:
        """The coded burst, if wanted, each edge with the time it was acknowledged."""
        for stamp, high in blink(self.controller) if self.led else ():
            self.event("led", f"{high:d} +-{stamp.half_width_ns} ns", stamp.wall_ns)

    def event(self, kind: str, text: str, wall_ns: int | None = None) -> None:
        """Record an event, now if no time is given."""
        self.writer.event(kind, text, self.controller.clock.wall_ns() if wall_ns is None else wall_ns)
        self.operator.happened(self.now_s(), kind, text)
