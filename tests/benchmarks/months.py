"""Months: a protocol of 60 days run to its end on an emulated controller with a stepped clock.

Everything is the rig's own (the run's loop, the driver, the wire, the recording and its thread) except the clock, on
which 60 days pass in minutes. The loop's rate is therefore low: one reading every two minutes makes 43,200. Memory, the
lateness of steps and the recording are checked during the run and at the end.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.plant import PressurePlant
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.recover import recover
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.soak import NoStraw

DAY = """{ hold = -25, for_s = 43200 }, { ramp = [-25, 35], for_s = 20000 }, { hold = 35, for_s = 23200 }"""
NO_STEPS_S = 1e9  # nothing behind the wire moves, so its history needs no steps


@dataclass
class LongRun:
    """Result of the run."""

    days: int
    cycles: int = 0
    missed: int = 0
    resident_mb: list[float] = field(default_factory=list)  # at each tenth of the run
    late_s: list[float] = field(default_factory=list)  # lateness of each step against the protocol
    readings: int = 0
    recovered: int = 0  # readings, from the file cut at nine tenths
    size_mb: float = 0.0
    wall_s: float = 0.0


def resident_mb() -> float:
    """Memory of this process (MB), on Linux; elsewhere the most so far."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1e3
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def run_months(days: int, period_s: float, folder: Path) -> LongRun:
    """Run ``days`` of the protocol with a cycle each ``period_s``, read it back, cut it, and recover it."""
    found, started_s = LongRun(days), time.monotonic()
    protocol = protocol_from_toml(
        f'pressure_unit = "kPa"\ninitial_deployed = []\n[[main]]\nrepeat = {days}\ndo = [{DAY}]', "months.toml"
    )
    clock, plant = SteppedClock(), PressurePlant(noise_pa=30.0)
    zero_ns = clock.wall_ns()

    def progress(now_s: float, duration_s: float, measured_pa: float) -> None:
        emulation.wire.received.clear()  # the emulator's own list of the last 100,000 requests
        while now_s >= duration_s * (len(found.resident_mb) + 1) / 10.0 - period_s:
            found.resident_mb.append(resident_mb())

    with (
        Emulation(NoStraw(), "ob1-mk4", plant=plant, clock=clock, step_s=NO_STEPS_S) as emulation,
        make_controller("ob1-mk4", emulation.url, clock=clock) as controller,
    ):
        outcome = run_protocol(controller, protocol, folder / "months.mcap", rate_hz=1.0 / period_s, progress=progress)
    found.cycles, found.missed = outcome.cycles, outcome.missed
    run = read_run(outcome.path)
    assert run.pressure is not None
    assert run.metadata["exit_status"] == "success"
    assert not run.lost
    found.readings = len(run.pressure)
    steps_s = np.array([event.time_s for event in run.events if event.kind == "step"])
    found.late_s = (steps_s - protocol.steps_s).tolist() if len(steps_s) == len(protocol.steps_s) else [np.inf]
    assert abs(clock.wall_ns() - zero_ns - protocol.duration_s * 1e9) < 1e9 * (period_s + 60.0)
    data = outcome.path.read_bytes()
    found.size_mb = len(data) / 1e6
    cut = folder / "cut.mcap.part"
    cut.write_bytes(data[: len(data) * 9 // 10])
    again = read_run(recover(cut).path)
    found.recovered = len(again.pressure or ())
    found.wall_s = time.monotonic() - started_s
    return found


def main() -> None:
    """Print the memory, the lateness and what is in the file."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--days", type=int, default=60)
    options.add_argument("--period-s", type=float, default=120.0)
    write_option(options)
    args = options.parse_args()
    with TemporaryDirectory() as folder:
        found = run_months(args.days, args.period_s, Path(folder))
    memory, late = found.resident_mb, found.late_s
    tenth = max(len(late) // 10, 1)
    print(
        f"{found.days} days in {found.wall_s:.0f} s: {found.cycles:,} cycles, {found.missed} missed, {len(late)} steps"
    )
    print(f"memory at each tenth of the run: {', '.join(f'{mb:.0f}' for mb in memory)} MB")
    print(f"steps late by at most {max(late[:tenth]):.3f} s in the first tenth, {max(late[-tenth:]):.3f} s in the last")
    print(f"{found.size_mb:.1f} MB, {found.readings:,} readings; cut at nine tenths, {found.recovered:,} are recovered")
    grown = memory[-1] - memory[0]
    # A cycle is never early, and a step is taken by the next cycle.
    kept = max(late) < args.period_s + 1.0
    figures = {
        "days": f"{found.days}",
        "readings": f"{found.readings:,}",
        "memory": f"{memory[0]:.0f} MB after a tenth, {memory[-1]:.0f} MB",
        "late": missed(f"{max(late):.2f} s", kept),
        "recovered": f"{found.recovered:,}",
    }
    print(f"memory grew by {grown:.1f} MB over nine tenths of the run")
    publish("months", figures, args.write)


if __name__ == "__main__":
    main()
