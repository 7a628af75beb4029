"""Options of the commands under straw rig; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import (
    Parser,
    about_options,
    command,
    controller_options,
    json_option,
    port_option,
    rig_options,
    straw_options,
    whole_number,
)


def drive_options(commands: argparse._SubParsersAction[Parser]) -> None:
    """Enter the commands that drive a controller."""
    rig = commands.add_parser("rig", help="drive a pressure controller, or emulate one")
    rig_commands = rig.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _run(rig_commands)
    _emulate(rig_commands)
    p = command(rig_commands, "check", "check wiring, readings, and the vent without and with pressure", "rig_check")
    rig_options(p)
    p.add_argument(
        "--pressure", type=float, default=2.0, metavar="KPA", help="pressure for the test of the vent; 0 skips it (2)"
    )
    straw_options(p, "the straw behind the emulator")
    json_option(p)
    p = command(rig_commands, "tell", "hold, resume, stop or vent a run in progress", module="rig_tell")
    p.add_argument("order", choices=("hold", "resume", "stop", "vent", "state"), help="the order, or state to ask")
    p.add_argument("run", nargs="?", type=Path, metavar="RUN.mcap", help="its recording (the one in progress in --dir)")
    p.add_argument("--dir", type=Path, default=Path(), metavar="DIR", help="where the recordings are (.)")
    p = command(rig_commands, "show", "draw a protocol and check it against its limits", module="rig_show")
    p.add_argument("protocol", type=Path, metavar="P.toml", help="the protocol")
    p.add_argument("-o", "--output", type=Path, metavar="PICTURE", help="png, svg or pdf (the protocol's name, png)")
    json_option(p)
    p = command(rig_commands, "vent", "vent one controller, or all known ones", module="rig_ports")
    port_option(p)
    p = command(
        rig_commands,
        "read",
        "print the readings of one controller, or of all known ones; nothing is set",
        module="rig_ports",
    )
    port_option(p)
    p = command(rig_commands, "ports", "list serial ports, and ports that were driven before", module="rig_ports")
    p.add_argument("--identify", action="store_true", help="ask each port which controller it is; nothing is set")
    p.set_defaults(action="ports")
    json_option(p)
    _snap_search(rig_commands)


def _run(rig_commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw rig run."""
    p = command(rig_commands, "run", "drive a protocol and record the run", module="rig_run")
    p.add_argument("protocol", type=Path, metavar="P.toml", help="the protocol")
    rig_options(p)
    p.add_argument("-o", "--output", type=Path, required=True, metavar="RUN.mcap", help="the recording")
    p.add_argument("--rate", type=float, metavar="HZ", help="samples per second (100)")
    p.add_argument("--specimen", metavar="NAME", help="which straw; overrides the protocol")
    p.add_argument("--cycle", type=whole_number, metavar="N", help="number of earlier cycles; overrides the protocol")
    about_options(p)
    p.add_argument("--led", action="store_true", help="blink a code on the trigger output, for the camera's clock")
    p.add_argument(
        "--live",
        nargs="?",
        const="127.0.0.1:0",
        metavar="HOST:PORT",
        help="serve a page to watch the run beside the model (127.0.0.1, any free port)",
    )
    p.add_argument("--watched", action="store_true", help=argparse.SUPPRESS)  # straw lab has the orders, the page VENT
    p.add_argument("--fast", action="store_true", help="with --emulate: as fast as possible instead of in real time")
    p.add_argument("--no-film", action="store_true", help="do not use the rig's camera")
    p.add_argument("--tip", type=Path, metavar="TIP.mcap", help="with --emulate: write the track of a perfect camera")
    straw_options(p, "the straw behind the emulator")
    json_option(p)


def _emulate(rig_commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw rig emulate."""
    p = command(
        rig_commands, "emulate", "an emulated controller on a port, with the straw behind it", module="rig_emulate"
    )
    p.add_argument("--controller", default="ob1-mk4", metavar="NAME", help="kind of controller (ob1-mk4)")
    p.add_argument(
        "--listen", default="127.0.0.1:0", metavar="URL", help="HOST:PORT, or pty (127.0.0.1, any free port)"
    )
    p.add_argument(
        "--setting",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="of the emulated instrument, as baud=38400; frame=mass: the six values that the PyPI client alicat reads",
    )
    p.set_defaults(limits=None)
    p.add_argument("--deployed", default="", metavar="CELLS", help="cells deployed at the start, as 1,4 (none)")
    p.add_argument("--faults", type=float, default=0.0, metavar="SHARE", help="share of exchanges to corrupt (0)")
    p.add_argument("--seed", type=whole_number, default=0, help="seed of the faults (0)")
    straw_options(p)


def _snap_search(rig_commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw rig snap-search."""
    p = command(rig_commands, "snap-search", "find the pressure at which a cell snaps", module="rig_snap_search")
    where = p.add_mutually_exclusive_group(required=True)
    where.add_argument("--port", metavar="URL", help="serial port, by-id path, or socket://host:port")
    where.add_argument("--emulate", action="store_true", help="no hardware: an emulator with the straw behind it")
    controller_options(p)
    p.add_argument("--cell", type=int, metavar="N", help="the cell to snap, alone in its state")
    p.add_argument("--deployed", metavar="CELLS", help='instead of --cell: cells deployed at the start, as 1,4 or ""')
    p.add_argument("--direction", required=True, choices=("fold", "deploy"), help="suction folds, pressure deploys")
    p.add_argument("--step", type=float, default=0.5, metavar="KPA", help="quasi-static step (0.5)")
    p.add_argument("--resolution", type=float, default=0.1, metavar="KPA", help="width at which bisection ends (0.1)")
    p.add_argument("--from", type=float, default=0.0, dest="start", metavar="KPA", help="first pressure (0)")
    p.add_argument("--to", type=float, metavar="KPA", help="last pressure (that of the limits)")
    p.add_argument("--repeats", type=int, default=1, metavar="N", help="number of searches (1)")
    p.add_argument("--ask", action="store_true", help="without a flow sensor: ask the operator what snapped")
    p.add_argument("-o", "--output", type=Path, metavar="RUN.mcap", help="record the search")
    about_options(p)
    straw_options(p, "the straw behind the emulator")
    json_option(p)
