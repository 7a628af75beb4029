"""straw rig run: drive a protocol on a controller, or on an emulator with the straw behind it, and record the run."""

from __future__ import annotations

import argparse
import time
from collections.abc import Collection
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.simulate import Stepper
from straw.model.straw_file import load_straw
from straw.replay.about_run import about_run, note_run
from straw.replay.commands.rig_of import settings_of, take_rig
from straw.replay.errors import ReplayError
from straw.replay.film.filming import Filming
from straw.replay.live.feed import Live
from straw.replay.output import check_new, write_json
from straw.replay.progress import prepare, progress_bar, say
from straw.rig.clock import SteppedClock
from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation, emulator_of
from straw.rig.guarded import GuardedController
from straw.rig.orders import Orders
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol
from straw.rig.run import Run
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_run
from straw.rig.session import Outcome, run_protocol
from straw.rig.twin import TwinHistory
from straw.tracking.trace import TipTrace


def run(args: argparse.Namespace) -> int:
    """Run the protocol and report the recording."""
    rig = take_rig(args)
    protocol = of_specimen(args, load_protocol(args.protocol))
    straw = load_straw(args.straw)
    about_run(args)  # errors in it are reported before anything else happens
    if rig is not None:
        protocol.check_limits(rig.limits)
    camera = rig.camera if rig and not args.no_film else None
    if camera and args.fast:
        raise ReplayError(
            "--fast does not run in real time, so nothing can be filmed: add --no-film, or leave out --fast"
        )
    with Filming(camera, args.output), live_of(args, straw, protocol) as live:
        return _run(args, straw, protocol, live)


def live_of(args: argparse.Namespace, straw: StrawParameters, protocol: PressureProtocol) -> Live | nullcontext[None]:
    """The page beside the run, if wanted."""
    if not args.live:
        return nullcontext()
    if args.fast:
        raise ReplayError("--live shows a run in real time; leave out --fast")
    check_new(args.output)
    prepare()
    return Live(straw, protocol, args.live, args.output, args.watched)


def _run(args: argparse.Namespace, straw: StrawParameters, protocol: PressureProtocol, live: Live | None) -> int:
    if live:
        say(f"the page of the run: {live.url}")
    if (args.fast or args.tip) and not args.emulate:
        raise ReplayError("--fast and --tip belong to --emulate: a real rig runs in real time and is filmed")
    check_new(args.output)
    try:
        if args.emulate:
            outcome = drive_emulated(args, straw, protocol, live)
        else:
            rig = GuardedController(args.controller, args.port, **channels_of(args, protocol))
            outcome = drive(
                rig, protocol, args.output, straw.cells, args.rate, args.led, live, **straw.laws, **about_of(args)
            )
    finally:
        if args.output.exists():  # a run that failed or was interrupted is a recording, too
            note_run(args, args.output)
    if args.json:
        write_json(args.json, {"recording": str(outcome.path), "cycles": outcome.cycles, "missed": outcome.missed})
    print(
        f"{protocol.name}: {outcome.cycles} samples at {outcome.rate_hz:.1f} Hz, {outcome.missed} missed; "
        f"recorded in {outcome.path}"
    )
    if outcome.stopped:
        say(f"{protocol.name}: {outcome.stopped}")
    return 1 if outcome.stopped else 0


def channels_of(args: argparse.Namespace, protocol: PressureProtocol) -> dict[str, Any]:
    """The controller's settings; by default the channels in use are those that the protocol drives."""
    return {"channels": tuple(part.channel for part in protocol.parts), **settings_of(args)}


def of_specimen(args: argparse.Namespace, protocol: PressureProtocol) -> PressureProtocol:
    """The protocol, with specimen and cycle from the command line in place of its file's."""
    specimen = protocol.specimen if args.specimen is None else args.specimen
    return replace(protocol, specimen=specimen, cycle=protocol.cycle if args.cycle is None else args.cycle)


def about_of(args: argparse.Namespace) -> dict[str, str]:
    """Metadata from the command line and the rig."""
    return ({"rig": str(args.rig)} if args.rig is not None else {}) | about_run(args)


def drive_emulated(
    args: argparse.Namespace, straw: StrawParameters, protocol: PressureProtocol, live: Live | None = None
) -> Outcome:
    """Run it on the emulator, in real time behind a guardian or as fast as possible; keep the tip if asked."""
    clock = SteppedClock() if args.fast else None
    if args.tip:
        check_new(args.tip)
    settings = channels_of(args, protocol)
    worn = straw.replace(cycle=float(protocol.cycle))  # from the recording's metadata
    with emulation(
        worn, protocol.initial_deployed, args.controller, clock=clock, channels=settings["channels"]
    ) as emulated:
        rig = (
            make_controller(args.controller, emulated.url, clock=clock, **settings)
            if clock
            else GuardedController(args.controller, emulated.url, remembered=False, **settings)
        )
        outcome = drive(
            rig, protocol, args.output, straw.cells, args.rate, args.led, live, **straw.laws, **about_of(args)
        )
    if args.tip:
        write_true_tip(args.tip, read_run(outcome.path), emulated.twin.history)
    return outcome


def write_true_tip(path: Path, recorded: Run, truth: TwinHistory) -> None:
    """The emulated straw's tip at 240 frames/s, as a track of the run it belongs to."""
    behind_s = (recorded.zero_time_ns - truth.zero_wall_ns) * 1e-9
    time_s = np.arange(truth.time_s[0] - behind_s, truth.time_s[-1] - behind_s, 1 / 240)
    x_m, z_m, phi_rad = (
        np.interp(time_s + behind_s, truth.time_s, axis) for axis in (truth.x_m, truth.z_m, truth.phi_rad)
    )
    n, unknown = len(time_s), np.full(len(time_s), np.nan)
    trace = TipTrace(time_s, x_m, z_m, phi_rad, unknown, unknown, unknown, np.ones(n, bool), np.arange(n))
    write_tip(
        path,
        trace,
        {**recorded.metadata, "tracker": "none: the emulated straw"},
        recorded.sha256,
        recorded.zero_time_ns,
    )


def emulation(
    straw: StrawParameters, deployed: Collection[int], controller: str, *addresses: str, **settings: Any
) -> Emulation:
    """An emulated controller with the straw in a configuration behind it, ready to be entered."""
    emulator_of(controller)  # a wrong name is reported before half a minute is spent
    prepare()
    now = straw.in_run(int(straw.cycle), time.time_ns())  # for laws that depend on time
    return Emulation(Stepper(now, deployed), controller, *addresses, **settings)


def drive(
    controller: Controller,
    protocol: PressureProtocol,
    output: Path,
    cells: int,
    rate_hz: float = 100.0,
    led: bool = False,
    live: Live | None = None,
    **metadata: str,
) -> Outcome:
    """Run a protocol on a controller and record it, with a bar; ``metadata`` joins ``straw.run``."""
    with (
        controller as opened,
        orders_of(opened, protocol, output, live) as reached_at,
        progress_bar(f"drive {protocol.name}", "ms") as progress,
    ):

        def reached(now_s: float, whole_s: float, measured_pa: float) -> None:
            progress(round(now_s * 1e3), round(whole_s * 1e3))

        return run_protocol(
            opened,
            protocol,
            output,
            rate_hz=rate_hz,
            led=led,
            metadata={"cells": str(cells), **metadata},
            progress=reached,
            operator=reached_at.operator if reached_at else None,
        )


def orders_of(
    controller: Controller, protocol: PressureProtocol, output: Path, live: Live | None
) -> Orders | nullcontext[None]:
    """Where orders to the run are taken, if it is to be watched."""
    if live is None:
        return nullcontext()
    guardian = None
    if isinstance(controller, GuardedController):
        guardian = {"pid": controller.guardian_pid, "heartbeat_s": controller.heartbeat_s}
    about = {
        "url": live.url,
        "protocol": protocol.name,
        "specimen": protocol.specimen,
        "duration_s": protocol.duration_s,
        "limits": str(controller.limits.and_also(protocol.limits)),
        "guardian": guardian,
    }
    return Orders(output, live, about)
