"""Safety: time from each way a script can end to the vent on the emulated controller's wire (POSIX)."""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from straw.rig.emulate import Emulation
from straw.rig.plant import PressurePlant
from straw.rig.wire import Wire
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.soak import NoStraw
from tests.rig.test_safety import READING, VENT, Script

REPEATS = 5
SAYS_WHEN = "time.sleep(0.3); print(time.monotonic_ns(), flush=True)"
WAYS: dict[str, tuple[str, Callable[[Script], object]]] = {
    "normal end": (SAYS_WHEN, lambda one: None),
    "an exception": (f"{SAYS_WHEN}; 1 / 0", lambda one: None),
    "Ctrl-C": (READING, lambda one: one.process.send_signal(signal.SIGINT)),
    "Ctrl-C, and again during clean-up": (READING, lambda one: _twice(one, signal.SIGINT)),
    "SIGTERM": (READING, lambda one: one.process.send_signal(signal.SIGTERM)),
    "SIGHUP, the terminal was closed": (READING, lambda one: one.process.send_signal(signal.SIGHUP)),
    "SIGKILL": (READING, lambda one: one.process.kill()),
    "os.abort, a crash": (f"{SAYS_WHEN}; os.abort()", lambda one: None),
    "frozen (SIGSTOP), heartbeat 1 s": (READING, lambda one: one.process.send_signal(signal.SIGSTOP)),
    "its guardian killed instead": (READING, lambda one: os.kill(one.guardian_pid, signal.SIGKILL)),
    "script and guardian killed at once": (READING, lambda one: _kill(one.process.pid, one.guardian_pid)),
    "its guardian hangs (SIGSTOP)": (READING, lambda one: os.kill(one.guardian_pid, signal.SIGSTOP)),
    "its guardian hangs, then Ctrl-C": (READING, lambda one: _hang_and_interrupt(one)),
}
WATCHED_S = 10.0


def _twice(one: Script, number: signal.Signals) -> None:
    one.process.send_signal(number)
    time.sleep(0.002)
    one.process.send_signal(number)


def _kill(*pids: int) -> None:
    for pid in pids:  # stopped first, so that none reacts to another's death
        os.kill(pid, signal.SIGSTOP)
    for pid in pids:
        os.kill(pid, signal.SIGKILL)


def _hang_and_interrupt(one: Script) -> None:
    os.kill(one.guardian_pid, signal.SIGSTOP)
    one.process.send_signal(signal.SIGINT)


def main() -> None:
    """Print the median and the longest of a few repeats."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    write_option(options)
    args = options.parse_args()
    took_ms = {}
    print(f"{'the script ends by':<36}{'median / ms':>12}{'longest / ms':>14}")
    for name, (then, end) in WAYS.items():
        took_ms[name] = show(name, [vented_after(then, end) for _ in range(REPEATS)])
    show("link lost, script dead, link returns", [vented_after_return() for _ in range(REPEATS)])
    print(f"all three killed, as when the computer dies: {left_after_all_died() / 1e3:+.1f} kPa after {WATCHED_S:g} s")
    killed, frozen = took_ms["SIGKILL"], took_ms["frozen (SIGSTOP), heartbeat 1 s"]
    figures = {"killed": f"{statistics.median(killed):.0f} ms, at most {max(killed):.0f}"}
    figures["frozen"] = f"heartbeat + {statistics.median(frozen) - 1000:.0f} ms"
    publish("safety", figures | {"repeats": f"{REPEATS}"}, args.write)


def show(name: str, took_s: list[float]) -> list[float]:
    """Print one line of the table; the times in ms."""
    print(f"{name:<36}{statistics.median(took_s) * 1e3:12.0f}{max(took_s) * 1e3:14.0f}", flush=True)
    return [1e3 * one for one in took_s]


def vented_after(then: str, end: Callable[[Script], object]) -> float:
    """Seconds from ending a script under pressure until the vent reached the wire."""
    with Emulation(NoStraw(), plant=PressurePlant(), latency_s=1e-3) as emulation:
        one = Script(emulation, then)
        try:
            took_s = one.vent_after(lambda: end(one))
            if not then.startswith(SAYS_WHEN):
                return took_s
            assert one.process.stdout is not None
            ended_s = (int(one.process.stdout.readline()) - emulation.twin._zero_ns) * 1e-9
            return next(at_s for at_s, line in emulation.wire.received if line == VENT and at_s > ended_s) - ended_s
        finally:
            one.process.kill()
            one.process.communicate()


def vented_after_return() -> float:
    """Seconds until the vent after the port exists again."""
    with Emulation(NoStraw(), plant=PressurePlant(), latency_s=1e-3) as emulation:
        one = Script(emulation, READING)
        time.sleep(0.1)
        emulation.wire.close()
        one.process.wait(10.0)
        start_s = emulation.twin.now()
        with Wire(emulation.device, emulation.url, clock=emulation.clock, now=emulation.twin.now) as again:
            while not again.received or again.received[-1][1] != VENT:
                time.sleep(0.001)
            took_s = again.received[-1][0] - start_s
            time.sleep(0.5)  # the guardian has its vent confirmed, and ends
        one.process.communicate()
        return took_s


def left_after_all_died() -> float:
    """Pressure (Pa) that is left ``WATCHED_S`` after script, guardian and standby were killed."""
    before = set(_standbys())
    with Emulation(NoStraw(), plant=PressurePlant(), latency_s=1e-3) as emulation:
        one = Script(emulation, READING)
        time.sleep(1.0)
        _kill(one.process.pid, one.guardian_pid, *set(_standbys()) - before)
        one.process.communicate()
        time.sleep(WATCHED_S)
        return emulation.plant.pressure(emulation.twin.now())


def _standbys() -> list[int]:
    """Process ids of all standbys (Linux)."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if b"straw.rig.standby" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return found


if __name__ == "__main__":
    main()
