"""Soak: ten thousand exchanges over a wire of which one in twenty is corrupted, and every outcome compared with the
truth.

A reading is wrong if the pressure had that value at no instant of its time span. A wrong one may be accepted only
where the protocol gives no way to detect it: noise that turned one valid answer into another.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import LinkLostError, RigError
from straw.rig.faults import Fault, SeededFaults
from straw.rig.plant import PressurePlant
from straw.rig.reading import Reading
from straw.rig.run_read import read_run
from straw.rig.run_write import RunWriter
from tests.benchmarks.figures import missed, publish, write_option

TIMEOUT_S = 0.06
SET_EVERY = 25


class NoStraw:
    """A plant without a straw."""

    time_s = volume_m3 = pressure_pa = 0.0
    tip = (0.0, 0.0, 0.0)

    def advance(self, time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        """Advance the time."""
        self.time_s = time_s


@dataclass
class Report:
    """Results of the exchanges."""

    exchanges: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    good: int = 0
    refused: int = 0  # reported as an error
    reopened: int = 0
    passed_untellable: list[str] = field(default_factory=list)  # wrong, and indistinguishable from a right one
    passed_wrong: list[str] = field(default_factory=list)
    events: int = 0  # read back from the recording
    longest_s: float = 0.0
    wall_s: float = 0.0


def soak(name: str, exchanges: int, rate: float, seed: int, folder: Path) -> Report:
    """Drive the named controller's emulator through seeded faults."""
    started_s = time.monotonic()
    report, random = Report(exchanges), np.random.default_rng(seed)
    faults = SeededFaults(rate, seed=seed, late_s=(0.0, 3 * TIMEOUT_S), away_s=0.15)
    plant = PressurePlant(noise_pa=0.0, resolution_pa=0.0)
    path = folder / f"soak-{name}-{seed}.mcap"
    with (
        Emulation(NoStraw(), name, plant=plant, latency_s=0.0, faults=faults) as emulation,
        RunWriter(path, {"run_id": "soak"}) as writer,
    ):
        controller = make_controller(name, emulation.url, timeout_s=TIMEOUT_S)
        is_open = False
        for k in range(exchanges):
            before_s, seen = time.monotonic(), len(faults.log)
            try:
                if not is_open:
                    controller.open()
                    is_open = True
                if k % SET_EVERY == 0:
                    wanted_pa = 500.0 * random.integers(-40, 41)
                    controller.set_pressure(1, wanted_pa)
                    wrong = "" if plant._told_pa == wanted_pa else f"set {wanted_pa}, told {plant._told_pa}"
                else:
                    wrong = misread(controller.read()[0], plant, emulation, controller)
                report.good += not wrong
                if wrong:
                    _judge(wrong, faults.log[seen:], report)
            except RigError as error:
                report.refused += 1
                writer.event("fault", str(error))
                if isinstance(error, LinkLostError):
                    report.reopened += 1
                    is_open = False
                    controller._close()
                    controller.is_open = False
            report.longest_s = max(report.longest_s, time.monotonic() - before_s)
        faults.rate = 0.0
        time.sleep(0.5)
        controller.is_open = False
        controller._close()
    report.faults = Counter(fault.kind for fault in faults.log)
    report.events = sum(event.kind == "fault" for event in read_run(path).events)
    report.wall_s = time.monotonic() - started_s
    return report


def misread(reading: Reading, plant: PressurePlant, emulation: Emulation, controller: Controller) -> str:
    """Empty if the pressure at some instant of the reading's time span was this, within half a step of the reading."""
    zero_ns = emulation.twin._zero_ns
    ends = [(reading.monotonic_ns + side * reading.half_width_ns - zero_ns) * 1e-9 for side in (-1, 1)]
    # The transmission time of the answer is subtracted from the span; an idle machine wakes late: a millisecond more.
    true_pa = np.array([plant.pressure(t) for t in np.linspace(ends[0] - 1e-3, ends[1] + 1e-3, 50)])
    half_step_pa = controller.resolution_pa / 2 + 1.0
    jump_pa = float(np.max(np.abs(np.diff(true_pa)), initial=0.0))
    if np.min(np.abs(true_pa - reading.pressure_pa)) <= half_step_pa + jump_pa:
        return ""
    return f"read {reading.pressure_pa} ({reading.raw!r}), true {true_pa.min():.0f}..{true_pa.max():.0f}"


def _judge(wrong: str, faults: list[Fault], report: Report) -> None:
    spelt_alike = [f for f in faults if f.kind in ("garble", "zero", "truncate") and f.sent != f.truth]
    if spelt_alike:
        report.passed_untellable.append(f"{spelt_alike[0].kind}: {spelt_alike[0].truth!r} to {spelt_alike[0].sent!r}")
    else:
        report.passed_wrong.append(f"{wrong} after {[(f.kind, f.request, f.sent) for f in faults]}")


def main() -> None:
    """Print the results of each controller's exchanges."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--exchanges", type=int, default=10_000)
    options.add_argument("--rate", type=float, default=0.05)
    options.add_argument("--seed", type=int, default=1)
    write_option(options)
    args = options.parse_args()
    figures = {"exchanges": f"{args.exchanges:,}", "share": f"{100 * args.rate:g} %"}
    for name in ("ob1-mk4", "alicat"):
        with TemporaryDirectory() as folder:
            r = soak(name, args.exchanges, args.rate, args.seed, Path(folder))
        kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(r.faults.items()))
        print(f"{name}: {r.exchanges} exchanges in {r.wall_s:.0f} s, {sum(r.faults.values())} spoilt ({kinds})")
        print(f"  good {r.good}, told as errors {r.refused} (all {r.events} in the recording), reopened {r.reopened}")
        print(f"  wrong and indistinguishable {len(r.passed_untellable)}; wrong and detectable {len(r.passed_wrong)}")
        print(f"  longest exchange, reopening included, {r.longest_s:.2f} s")
        for line in (r.passed_untellable + r.passed_wrong)[:20]:
            print("   ", line)
        wrong = len(r.passed_wrong)
        figures |= {f"{name}-wrong": missed(f"{wrong}", wrong == 0), f"{name}-alike": f"{len(r.passed_untellable)}"}
    publish("soak", figures, args.write)


if __name__ == "__main__":
    main()
