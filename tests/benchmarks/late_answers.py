"""Runs of a minute on an instrument whose answers are corrupted or late: how many succeed, which readings are wrong.

One answer in twenty is garbled, cut, merged with the next, lost, or up to 2 s late. Every reading is compared with the
plant's pressure within the reading's time span.
"""

from __future__ import annotations

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.faults import SeededFaults
from straw.rig.plant import PressurePlant
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.reading import Reading
from straw.rig.session import run_protocol
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.soak import NoStraw, misread

KINDS = ("garble", "truncate", "merge", "silence", "late")
SPELT = ("garble", "truncate")  # without a checksum one of these may look like a right answer
PROTOCOL = """
pressure_unit = "kPa"
initial_deployed = []
[[main]]
sine = {{ mean = 0, amplitude = 20, frequency_hz = 0.1 }}
for_s = {for_s}
"""


@dataclass(frozen=True)
class RunResult:
    """Result of one run."""

    well: bool
    why: str
    cycles: int
    faults: Counter[str]
    wrong: tuple[str, ...]  # readings of another moment
    spelt_alike: int


def one(seed: int, baud: int, for_s: float, rate: float, late_s: float, kinds: tuple[str, ...]) -> RunResult:
    """One run on an Alicat at this line rate."""
    faults = SeededFaults(rate, seed=seed, kinds=kinds, late_s=(0.0, late_s))
    plant = PressurePlant(noise_pa=0.0, resolution_pa=0.0)
    wrong: list[str] = []
    alike = cycles = 0
    with (
        TemporaryDirectory() as folder,
        Emulation(NoStraw(), "alicat", plant=plant, faults=faults, device={"baud": baud}) as emulation,
    ):
        controller = make_controller("alicat", emulation.url, baud=baud)
        read = controller.read

        def judged() -> tuple[Reading, ...]:
            nonlocal alike
            seen = len(faults.log)
            readings = read()
            if text := misread(readings[0], plant, emulation, controller):
                if any(fault.kind in SPELT and fault.sent != fault.truth for fault in faults.log[seen:]):
                    alike += 1
                else:
                    wrong.append(f"seed {seed}: {text}")
            return readings

        controller.read = judged  # type: ignore[method-assign]
        try:
            with controller:
                protocol = protocol_from_toml(PROTOCOL.format(for_s=for_s), "minute.toml")
                cycles = run_protocol(controller, protocol, Path(folder) / "run.mcap").cycles
            why = ""
        except RigError as error:
            why = str(error)
    return RunResult(not why, why, cycles, Counter(fault.kind for fault in faults.log), tuple(wrong), alike)


def main() -> None:
    """Print the results of the runs at each line rate."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs", type=int, default=20)
    options.add_argument("--for-s", type=float, default=60.0)
    options.add_argument("--rate", type=float, default=0.05)
    options.add_argument("--late-s", type=float, default=2.0)
    options.add_argument("--bauds", type=int, nargs="+", default=[9600, 19200, 38400, 115200])
    options.add_argument("--kinds", nargs="+", default=KINDS)
    options.add_argument("--at-once", type=int, default=10, help="runs mostly wait")
    write_option(options)
    args = options.parse_args()
    every: list[RunResult] = []
    for baud in args.bauds:
        with ProcessPoolExecutor(args.at_once) as pool:
            jobs = [
                pool.submit(one, seed, baud, args.for_s, args.rate, args.late_s, tuple(args.kinds))
                for seed in range(args.runs)
            ]
            ended = [job.result() for job in jobs]
        every += ended
        faults = sum((run.faults for run in ended), Counter[str]())
        print(
            f"{baud} baud: {sum(run.well for run in ended)} of {len(ended)} ended well; {sum(r.cycles for r in ended)} "
            f"cycles, {dict(sorted(faults.items()))}; wrong readings {sum(len(run.wrong) for run in ended)}, "
            f"indistinguishable from right ones {sum(run.spelt_alike for run in ended)}",
            flush=True,
        )
        for run in ended:
            for text in (*run.wrong[:3], *([run.why] if run.why else [])):
                print("  ", text)
    well, wrong = sum(run.well for run in every), sum(len(run.wrong) for run in every)
    figures = {
        "well": missed(f"{well} of {len(every)}", well == len(every)),
        "wrong": missed(f"{wrong}", wrong == 0),
        "cycles": f"{sum(run.cycles for run in every):,}",
    }
    publish("late_answers", figures, args.write)


if __name__ == "__main__":
    main()
