"""straw rig emulate: a controller on the wire with the straw behind it, until Ctrl-C or SIGTERM."""

from __future__ import annotations

import argparse
import time
from collections import Counter

from straw.model.straw_file import load_straw
from straw.replay.commands.rig_run import emulation
from straw.replay.commands.rig_settings import settings_of
from straw.replay.errors import ReplayError
from straw.rig.faults import SeededFaults
from straw.rig.interrupts import Interrupts


def run(args: argparse.Namespace) -> int:
    """Serve, and print where."""
    straw, deployed = load_straw(args.straw), cells_of(args.deployed)
    if not 0.0 <= args.faults <= 1.0:
        raise ReplayError(f"--faults {args.faults:g}: expected a share of exchanges, 0 to 1")
    faults = SeededFaults(args.faults, seed=args.seed) if args.faults else None
    with (
        Interrupts() as interrupts,
        emulation(straw, deployed, args.controller, args.listen, faults=faults, device=settings_of(args)) as emulated,
    ):
        print(f"{args.controller} with a straw of {straw.cells} cells at {emulated.url}; Ctrl-C ends it", flush=True)
        while interrupts.pending is None:
            time.sleep(0.1)
        x_m, z_m, _ = emulated.twin.stepper.tip
    if faults:
        kinds = Counter(fault.kind for fault in faults.log)
        print("faults:", ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items())) or "none")
    print(f"ended; the tip stood at X {x_m * 1e3:.2f} mm, Z {z_m * 1e3:.2f} mm")
    return 0


def cells_of(text: str) -> list[int]:
    """Cell numbers from text like 1,4."""
    try:
        return [int(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise ReplayError(f"--deployed {text}: expected cell numbers with commas between, as 1,4") from None
