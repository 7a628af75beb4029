"""straw rig snap-search: quasi-static steps and bisection to the pressure at which a cell snaps, with its interval."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import asdict

from straw.model.parameters import StrawParameters
from straw.model.simulate import Stepper
from straw.model.straw_file import load_straw
from straw.replay.about_run import about_run, note_run
from straw.replay.commands.rig_emulate import cells_of
from straw.replay.commands.rig_of import settings_of
from straw.replay.commands.rig_run import emulation
from straw.replay.errors import ReplayError
from straw.replay.output import check_new, write_json
from straw.replay.progress import say
from straw.rig.clock import SteppedClock
from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.guarded import GuardedController
from straw.rig.interrupts import Interrupts
from straw.rig.reading import Reading
from straw.rig.run_write import RunWriter
from straw.rig.snap_search import Reset, SnapFound, SnapPlan, snap_search
from straw.rig.watch import AskingWatcher, MotionWatcher, Watcher, volume_from_flow

TWIN_STEP_S = 5e-3  # quasi-static: nothing here depends on a millisecond


def run(args: argparse.Namespace) -> int:
    """Search, and print the interval."""
    straw = load_straw(args.straw)
    deployed = deployed_of(args, straw.cells)
    about_run(args)  # errors in it are reported before anything else happens
    if args.output:
        check_new(args.output)
    rig = emulated_rig if args.emulate else real_rig
    with rig(args, straw, deployed) as (controller, watcher, reset):
        plan = plan_of(args, controller)
        writer = RunWriter(args.output, metadata_of(args, straw, deployed, controller)) if args.output else None
        try:
            found = snap_search(controller, plan, watcher, reset, writer=writer, progress=told)
        finally:
            if writer:
                writer.finish()
                note_run(args, writer.path)
    if args.json:
        write_json(args.json, as_data(found))
    print(summary(found, args.direction))
    return 0


def deployed_of(args: argparse.Namespace, cells: int) -> list[int]:
    """The configuration at the start: as given, or the one in which the wanted cell snaps alone."""
    if args.deployed is not None:
        return cells_of(args.deployed)
    if args.cell is None or not 1 <= args.cell <= cells:
        raise ReplayError(f"--cell {args.cell}: give the cell that is to snap, 1 to {cells}, or --deployed CELLS")
    return [args.cell] if args.direction == "fold" else [cell for cell in range(1, cells + 1) if cell != args.cell]


def plan_of(args: argparse.Namespace, controller: Controller) -> SnapPlan:
    """The search in SI, by default as far as the limits reach."""
    sign = -1.0 if args.direction == "fold" else 1.0
    limit_pa = controller.limits.min_pa if sign < 0 else controller.limits.max_pa
    start_pa = sign * abs(args.start) * 1e3
    end_pa = limit_pa if args.to is None else sign * abs(args.to) * 1e3
    return SnapPlan(start_pa, end_pa, args.step * 1e3, args.resolution * 1e3, args.repeats)


@contextmanager
def emulated_rig(
    args: argparse.Namespace, straw: StrawParameters, deployed: Collection[int]
) -> Iterator[tuple[Controller, Watcher, Reset | None]]:
    """The emulator on a clock that runs as fast as the arithmetic; the twin's tip is watched."""
    clock = SteppedClock()
    with (
        emulation(straw, deployed, args.controller, clock=clock, step_s=TWIN_STEP_S) as emulated,
        make_controller(args.controller, emulated.url, clock=clock, **settings_of(args)) as controller,
    ):
        yield controller, tip_watcher(emulated), lambda: put_back(emulated, straw, deployed)


def tip_watcher(emulated: Emulation) -> MotionWatcher:
    """Watches the emulated straw's tip, m; an angle counts as on an arm of 0.1 m."""

    def position(reading: Reading) -> tuple[float, float, float]:
        emulated.catch_up()
        x_m, z_m, phi_rad = emulated.twin.stepper.tip
        return x_m, z_m, 0.1 * phi_rad

    return MotionWatcher(position)


def put_back(emulated: Emulation, straw: StrawParameters, deployed: Collection[int]) -> None:
    """Reset the emulated straw, as is done by hand on a real rig after venting."""
    emulated.clock.sleep(1.0)
    emulated.catch_up()
    emulated.twin.stepper = Stepper(straw, deployed, emulated.twin.stepper.time_s)


@contextmanager
def real_rig(
    args: argparse.Namespace, straw: StrawParameters, deployed: Collection[int]
) -> Iterator[tuple[Controller, Watcher, Reset | None]]:
    """A controller behind its guardian, watched by a flow sensor or a person who answers."""
    with GuardedController(args.controller, args.port, **settings_of(args)) as controller:

        def ask(told_pa: float) -> bool:
            return answered(controller, f"{told_pa / 1e3:g} kPa: did a cell snap? [y/N] ").lower().startswith("y")

        def reset() -> None:
            cells = ",".join(map(str, deployed)) or "none"
            answered(controller, f"vented. Set the straw to cells deployed: {cells}; then press Enter ")

        watcher = AskingWatcher(ask) if args.ask else volume_from_flow()
        yield controller, watcher, reset if sys.stdin.isatty() else None


def answered(controller: Controller, question: str) -> str:
    """Ask while the pressure is held, with heartbeats to the guardian meanwhile."""
    import os
    import threading

    answer: list[bytes] = []

    def listen() -> None:
        # Not sys.stdin: Python aborts if it ends (by Ctrl-C, say) while a thread still reads from it.
        while (byte := os.read(sys.stdin.fileno(), 1)) not in (b"", b"\n"):
            answer.append(byte)

    print(question, end="", file=sys.stderr, flush=True)
    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    # checked here, as the search, which waits for the answer, does not check signals meanwhile
    with Interrupts() as interrupts:
        while thread.is_alive():
            interrupts.check()
            controller.read()
            thread.join(0.2)
    return b"".join(answer).decode(errors="replace").strip()


def metadata_of(
    args: argparse.Namespace, straw: StrawParameters, deployed: Collection[int], controller: Controller
) -> dict[str, str]:
    """What a recording of the search says about itself."""
    return {
        "run_id": args.output.stem,
        "specimen": "",
        "cycle": "0",
        "cells": str(straw.cells),
        "initial_deployed": ",".join(map(str, deployed)),
        "zero_time_ns": str(controller.clock.wall_ns()),
        "protocol": f"snap search, {args.direction}, steps of {args.step:g} kPa to {args.resolution:g} kPa",
        **controller.snapshot(),
        **about_run(args),
    }


def told(pressure_pa: float, how: str) -> None:
    """Print one hold where a person watches."""
    if sys.stderr.isatty():
        say(f"  {pressure_pa / 1e3:+.2f} kPa {how}")


def as_data(found: SnapFound) -> dict[str, object]:
    """The result for machines, SI."""
    return {
        "pressure_pa": found.pressure_pa,
        "sigma_pa": found.sigma_pa,
        "interval_pa": list(found.interval_pa),
        "searches": [
            {"interval_pa": list(b.interval_pa), "below": asdict(b.below), "above": asdict(b.above)}
            for b in found.brackets
        ],
    }


def summary(found: SnapFound, direction: str) -> str:
    """One line for each search, then the result."""
    lines = [
        f"search {k}: held at {b.below.told_pa / 1e3:+.2f} kPa (read {b.below.read_pa / 1e3:+.3f}), "
        f"snapped at {b.above.told_pa / 1e3:+.2f} kPa (read {b.above.read_pa / 1e3:+.3f})"
        for k, b in enumerate(found.brackets, 1)
    ]
    low, high = found.interval_pa
    lines.append(
        f"snap ({direction}): {found.pressure_pa / 1e3:+.3f} kPa +- {found.sigma_pa / 1e3:.3f} (1 sigma), "
        f"within {low / 1e3:+.3f} .. {high / 1e3:+.3f} kPa"
    )
    return "\n".join(lines)
