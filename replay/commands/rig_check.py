"""straw rig check: whether the rig matches its file, every channel reads, and the vent works."""

from __future__ import annotations

import argparse
import time
from typing import Any

from straw.model.straw_file import load_straw
from straw.replay.commands.rig_of import settings_of, take_rig
from straw.replay.commands.rig_run import emulation
from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.replay.progress import say
from straw.rig.camera.gopro import GoPro
from straw.rig.controller import Controller
from straw.rig.errors import RigError
from straw.rig.guarded import GuardedController
from straw.rig.rig_file import load_rig

SETTLE_S = 1.0
#: Tolerance of a channel against its command: the OB1's accuracy is 100 Pa a step, plus drift.
NEAR_PA = 300.0
TRIES = 5


def run(args: argparse.Namespace) -> int:
    """Try everything; 0 when every check passes, 1 when not."""
    rig = take_rig(args)
    settings = settings_of(args)
    name = f"{rig.name} ({rig.path})" if rig else args.controller
    say(f"{name}: {args.controller} on {args.port or 'the emulator'}, channels {settings.get('channels', (1,))}")
    if args.emulate:
        channels = settings.get("channels", (1,))
        with emulation(load_straw(args.straw), (), args.controller, channels=channels) as emulated:
            return report(GuardedController(args.controller, emulated.url, **settings), args)
    return report(GuardedController(args.controller, args.port, **settings), args)


def report(controller: Controller, args: argparse.Namespace) -> int:
    """Print and write what was found."""
    pressure_pa = args.pressure * 1e3
    reason = controller.limits.why_not(pressure_pa)
    if reason:
        raise ReplayError(
            f"--pressure {args.pressure:g}: {reason}; give another one, or 0 to try the vent without pressure"
        )
    with controller:
        found = checked(controller, pressure_pa)
    for key, value in found["instrument"].items():
        print(f"{key:<12} {value}")
    for row in found["channels"]:
        print(f"channel {row['channel']}: {row['says']}")
    found["camera"] = camera_says(args)
    if found["camera"]:
        print(found["camera"]["says"])
    well = all(row["well"] for row in found["channels"]) and found["camera"].get("well", True)
    print("all checks passed" if well else "a check failed: see above, and check tubes, valves, supply and camera")
    if args.json:
        write_json(args.json, found | {"well": well})
    return 0 if well else 1


def camera_says(args: argparse.Namespace) -> dict[str, Any]:
    """Whether the rig's camera answers; empty where there is none to ask."""
    camera = load_rig(args.rig).camera if args.rig else None
    if camera is None or camera.kind != "gopro":
        return {}
    try:
        with GoPro(camera.address) as gopro:
            count = len(gopro.clips())
    except RigError as error:
        return {"well": False, "says": f"camera: FAILED: {error}"}
    return {"well": True, "says": f"camera: ok: {camera.address} answers, {count} files on its card"}


def checked(controller: Controller, pressure_pa: float) -> dict[str, Any]:
    """Each channel vented, put under a little pressure (Pa; 0: not), and vented from it."""
    instrument = controller.snapshot()
    rows = []
    for channel in controller.channels:
        told, well = [], True
        for step_pa in (0.0, pressure_pa) if pressure_pa else (0.0,):
            if step_pa:
                controller.set_pressure(channel, step_pa)
                reached = _near(controller, channel, step_pa)
                told.append(f"at a command of {step_pa / 1e3:g} kPa it shows {reached / 1e3:.2f} kPa")
                well &= abs(reached - step_pa) <= NEAR_PA
            began_s = time.monotonic()
            controller.vent_channel(channel)
            left = _near(controller, channel, 0.0)
            took_s = time.monotonic() - began_s
            told.append(f"vented from {step_pa / 1e3:g} kPa it shows {left / 1e3:.2f} kPa after {took_s:.2f} s")
            well &= abs(left) <= NEAR_PA
        flow = next(r.flow_m3_s for r in controller.read() if r.channel == channel)
        told.append("no flow sensor" if flow != flow else f"flow {flow * 1e9:.2f} µl/s")
        rows.append({"channel": channel, "well": well, "says": ("ok: " if well else "FAILED: ") + "; ".join(told)})
    return {"instrument": instrument, "channels": rows}


def _near(controller: Controller, channel: int, wanted_pa: float) -> float:
    """The mean of a few readings, once the channel has reached its command, or its time is over."""
    until_s = time.monotonic() + SETTLE_S
    while True:
        found = [next(r.pressure_pa for r in controller.read() if r.channel == channel) for _ in range(TRIES)]
        mean = sum(found) / len(found)
        if abs(mean - wanted_pa) <= NEAR_PA / 2 or time.monotonic() > until_s:
            return mean
        time.sleep(0.02)
