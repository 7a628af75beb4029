"""straw rig ports, read, vent: list instruments, read them, vent them."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from straw.replay.commands.rig_settings import settings_of
from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.rig.drivers import controller_names, make_controller
from straw.rig.errors import RigError
from straw.rig.line_controller import LineController
from straw.rig.ports import Known, is_guarded, known_ports
from straw.rig.vent import Vented, look, vent_known

DEFAULT = "ob1-mk4"
KPA = 1e3


def run(args: argparse.Namespace) -> int:
    """Call the function of the command."""
    return ACTIONS[args.action](args)


def vent(args: argparse.Namespace) -> int:
    """Vent one instrument, or all known ones; 1 where that is not certain."""
    done = []
    for known in wanted(args):
        print(f"venting {known.port} ({known.controller})", file=sys.stderr, flush=True)
        done.append(vent_known(known))
        print(_vented(done[-1]))
    if args.json:
        write_json(args.json, {"vented": [asdict(one) | {"is_empty": one.is_empty} for one in done]})
    there = [one for one in done if one.is_there]
    if not there:
        raise RigError(done[0].problem if args.port else "none of the known ports is connected; name one with --port")
    return 0 if all(one.is_empty for one in there) else 1


def read(args: argparse.Namespace) -> int:
    """Print the readings of one instrument, or of all known ones; nothing is set, vented or changed."""
    rows: list[dict[str, Any]] = []
    problems: list[str] = []
    for known in wanted(args):
        try:
            readings, about = look(known)
        except RigError as error:
            problems.append(str(error))
            continue
        for reading in readings:
            row = {"port": known.port, "controller": known.controller, "channel": reading.channel}
            flow = {} if reading.flow_m3_s != reading.flow_m3_s else {"flow_m3_s": reading.flow_m3_s}
            rows.append(row | {"pressure_pa": reading.pressure_pa, "wall_ns": reading.wall_ns, "about": about} | flow)
            print(f"{known.port} ({known.controller}), channel {reading.channel}: {reading.pressure_pa / KPA:+.2f} kPa")
    if args.json:
        write_json(args.json, {"readings": rows, "problems": problems})
    if not rows:
        raise RigError(problems[0])
    for text in problems:
        print(f"not read: {text}")
    return 0


def ports(args: argparse.Namespace) -> int:
    """Serial ports of this computer, and ports that a controller was driven through before."""
    from serial.tools.list_ports import comports

    known = {one.port: one for one in known_ports()}
    rows: list[dict[str, Any]] = [
        {"port": port.device, "here": True, "what": port.description, "id": port.hwid} for port in sorted(comports())
    ]
    rows += [
        {"port": name, "here": None, "what": "", "id": ""} for name in known if name not in [r["port"] for r in rows]
    ]
    for row in rows:
        one = known.get(row["port"])
        row["controller"] = one.controller if one else ""
        row["used_ns"] = one.used_ns if one else 0
        row["guardian_pid"] = one.guardian_pid if one and is_guarded(one) else 0
        if args.identify and not row["guardian_pid"]:
            row["controller"], row["about"] = identified(row["port"], one)
    if args.json:
        write_json(args.json, {"ports": rows})
    for row in rows:
        held = f"; a run is driven through it (guardian {row['guardian_pid']})" if row["guardian_pid"] else ""
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(row["used_ns"] * 1e-9)) if row["used_ns"] else "never"
        what = row["what"] or ("on the network" if "://" in row["port"] else "not plugged in")
        about = "".join(f"; {key} {row['about'][key]}" for key in ("firmware", "model") if key in row.get("about", {}))
        print(f"{row['port']}  {row['controller'] or '?'}  {what}; last driven: {used}{about}{held}")
    if not rows:
        print(
            "no serial port found here, and none was driven before; plug the controller in, or name socket://host:port"
        )
    return 0


def identified(port: str, known: Known | None) -> tuple[str, dict[str, str]]:
    """The kind of line controller that answers on a port, and its description; nothing is set. Empty where none
    does."""
    kinds = [known] if known else [Known(port, name) for name in controller_names()]
    for one in kinds:
        try:
            controller = make_controller(one.controller, port, **one.settings)
            if isinstance(controller, LineController):
                with controller.looking():
                    return one.controller, controller.snapshot()
        except RigError:
            continue
    return "", {}


def wanted(args: argparse.Namespace) -> list[Known]:
    """The named port, with its stored settings; or every known port."""
    known = known_ports()
    if not args.port:
        if not known:
            raise ReplayError("no port is known: nothing was driven from here; name one with --port (straw rig ports)")
        return known
    before = next((one for one in known if one.port == args.port), None)
    controller = args.controller or (before.controller if before else DEFAULT)
    settings = dict(before.settings) if before and before.controller == controller else {}
    return [Known(args.port, controller, settings | settings_of(args), before.guardian_pid if before else 0)]


def _vented(one: Vented) -> str:
    ended = (
        f"guardian {one.ended_guardian}, which drove a run, was told to vent and end; " if one.ended_guardian else ""
    )
    reads = ", ".join(f"channel {channel} {p / KPA:+.2f} kPa" for channel, p in one.pressure_pa.items())
    if not one.is_there:
        return f"{one.port} ({one.controller}): {ended}not there: {one.problem}"
    if not one.confirmed:
        return f"{one.port} ({one.controller}): {ended}NOT VENTED, open a valve by hand: {one.problem}"
    return f"{one.port} ({one.controller}): {ended}{one.problem or f'vented, reads {reads}'}"


ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {"ports": ports, "read": read, "vent": vent}
