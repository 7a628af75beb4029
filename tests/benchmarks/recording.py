"""Recording: a minute of 1 kHz pressure and a 240 Hz track through the queue writer: CPU cost and losses."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from straw.rig.run_read import read_run
from straw.rig.run_write import RunWriter
from tests.benchmarks.figures import missed, publish, write_option

NAMED = {"run_id": "benchmark", "specimen": "none", "initial_deployed": "", "cycle": "0", "cells": "9"}
RAW = b">PINGA?|OK|-250:0:1:0:0:0:0:0:0:0:0:0\n"


class DiscardedRecording:
    """Accepts messages as a recording does, and discards them."""

    def add(self, topic: str, happened_ns: int, **values: Any) -> None:
        """Discard a message."""

    def finish(self) -> None:
        """Nothing to finish."""


def main() -> None:
    """Print the share of a core, and what is in the file."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=60.0)
    write_option(options)
    args = options.parse_args()
    seconds = args.seconds
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        # The loop alone, half of it before and half after, since other load of the machine changes slowly.
        loop_s = paced(seconds / 2, DiscardedRecording())[0]
        all_s, behind_s, pressures, tips = paced(
            seconds, RunWriter(path, {**NAMED, "zero_time_ns": str(time.time_ns())})
        )
        loop_s += paced(seconds / 2, DiscardedRecording())[0]
        run = read_run(path)
        size = path.stat().st_size
    assert run.pressure is not None
    assert run.tip is not None
    print(f"{seconds:g} s: {pressures} pressures and {tips} poses written, {len(run.pressure)} and {len(run.tip)} read")
    dropped = pressures - len(run.pressure) + tips - len(run.tip)
    print(f"dropped {dropped}; lost: {run.lost or 'nothing'}")
    print(
        f"{(all_s - loop_s) / seconds:.2%} of a core: the process took {all_s / seconds:.2%}, "
        f"the same loop without a recording {loop_s / seconds:.2%}"
    )
    print(f"the loop that keeps the pace was at most {behind_s * 1e3:.1f} ms behind; nothing waits for the disk")
    print(f"{size / 1e6:.2f} MB, {size / (pressures + tips):.0f} bytes a message")
    figures = {"dropped": missed("nothing" if dropped == 0 else f"{dropped} messages", dropped == 0)}
    publish("recording", figures | {"core": f"{100 * (all_s - loop_s) / seconds:.1f} %"}, args.write)


def paced(seconds: float, writer: RunWriter | DiscardedRecording) -> tuple[float, float, int, int]:
    """CPU seconds of the process up to the finished file, the longest the loop was behind (s), pressures and poses."""
    random = np.random.default_rng(0).normal(size=(1000, 4)).tolist()
    pressures = tips = 0
    behind_s = 0.0
    used_s = time.process_time()
    start_s, wall_ns = time.monotonic(), time.time_ns()
    while (now_s := time.monotonic() - start_s) < seconds:
        due_p, due_t = int(now_s * 1000) + 1, int(now_s * 240) + 1
        behind_s = max(behind_s, now_s - pressures / 1000)
        for k in range(pressures, due_p):
            writer.add(
                "/pressure/measured",
                wall_ns + k * 1_000_000,
                pressure_pa=random[k % 1000][0],
                sigma_pa=30.0,
                channel=1,
                monotonic_ns=k * 1_000_000,
                half_width_ns=2_000_000,
                raw=RAW,
                flow_m3_s=random[k % 1000][1],
            )
        for k in range(tips, due_t):
            _, x, z, phi = random[k % 1000]
            writer.add(
                "/tip/state",
                wall_ns + k * 1_000_000_000 // 240,
                x_m=x,
                z_m=z,
                phi_rad=phi,
                sigma_x_m=1e-5,
                sigma_z_m=1e-5,
                sigma_phi_rad=1e-4,
                valid=True,
                frame=k,
            )
        pressures, tips = due_p, due_t
        time.sleep(1e-3)
    writer.finish()
    return time.process_time() - used_s, behind_s, pressures, tips


if __name__ == "__main__":
    main()
