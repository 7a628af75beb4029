"""straw rig run: drive a protocol on a controller, or on an emulator with the straw behind it, and record the run."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from pathlib import Path

from model.parameters import StrawParameters, load_straw
from model.simulate import Stepper
from replay.output import write_json
from replay.progress import prepare, progress_bar
from rig.emulate import Emulation, emulator_of
from rig.guarded import GuardedController
from rig.protocol import PressureProtocol, load_protocol
from rig.session import Outcome, run_protocol


def run(args: argparse.Namespace) -> int:
    """Run the protocol and say what was recorded."""
    protocol = load_protocol(args.protocol)
    straw = load_straw(args.straw)
    if args.emulate:
        with emulation(straw, protocol.initial_deployed, args.controller) as emulated:
            outcome = drive(args.controller, emulated.url, protocol, args.output, straw.cells, args.rate)
    else:
        outcome = drive(args.controller, args.port, protocol, args.output, straw.cells, args.rate)
    if args.json:
        write_json(args.json, {"recording": str(outcome.path), "cycles": outcome.cycles, "missed": outcome.missed})
    print(
        f"{protocol.name}: {outcome.cycles} samples at {outcome.rate_hz:.1f} Hz, {outcome.missed} missed; "
        f"recorded in {outcome.path}"
    )
    return 0


def emulation(straw: StrawParameters, deployed: Collection[int], controller: str, *addresses: str) -> Emulation:
    """An emulated controller with the straw in a configuration behind it, ready to be entered."""
    emulator_of(controller)  # a wrong name is answered before half a minute is spent
    prepare()
    return Emulation(Stepper(straw, deployed), controller, *addresses)


def drive(
    controller: str,
    port: str,
    protocol: PressureProtocol,
    output: Path,
    cells: int,
    rate_hz: float = 100.0,
    **metadata: str,
) -> Outcome:
    """Run a protocol on the controller at a port and record it, with a bar; ``metadata`` joins ``straw.run``."""
    with GuardedController(controller, port) as opened, progress_bar(f"drive {protocol.name}", "ms") as progress:
        return run_protocol(
            opened,
            protocol,
            output,
            rate_hz=rate_hz,
            metadata={"cells": str(cells), **metadata},
            progress=lambda now_s, whole_s, _: progress(round(now_s * 1e3), round(whole_s * 1e3)),
        )
