"""The ``straw`` command: parses the command line; nothing heavy is imported until a command runs."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

from straw.model.plugged import add_laws, files_named_in, laws_named_in, straw_of_rig
from straw.replay.commands.film_options import calibrate_command, clock_command, track_command
from straw.replay.commands.judge_options import diagnose_command, identify_commands, replay_command
from straw.replay.commands.model_options import model_commands, simulate_command
from straw.replay.commands.rig_options import drive_options
from straw.replay.commands.runs_options import runs_options
from straw.replay.errors import USER_ERRORS
from straw.replay.investigate.options import investigate_options
from straw.replay.options import (
    Parser,
    VersionAction,
    command,
    json_option,
    rig_options,
    straw_options,
    whole_number,
)
from straw.replay.tables.options import export_options, import_options


def parser() -> argparse.ArgumentParser:
    """Every command and its options."""
    top = Parser(
        prog="straw", description="Drive, film, track, compare and diagnose inflatable multistable structures."
    )
    top.add_argument("--version", action=VersionAction, nargs=0, help="the version, and in a clone the commit")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    p = command(commands, "demo", "the whole loop without hardware: drive, film, track, compare, diagnose")
    p.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="folder for all results (demo)")
    p.add_argument("--measured", action="store_true", help="diagnose a measured recording instead")
    p.add_argument("--seed", type=whole_number, default=1, help="seed of the noise and of what is concealed (1)")
    json_option(p)

    simulate_command(commands)
    drive_options(commands)

    calibrate_command(commands)
    runs_options(commands)
    p = command(commands, "import", "make a recording from the tables of another logger", module="import_")
    import_options(p)
    json_option(p)
    p = command(commands, "export", "write a recording as a table, which straw import reads back bit for bit")
    export_options(p)
    json_option(p)

    p = command(commands, "lab", "serve the catalogue and the operator's panel as a local page")
    p.add_argument(
        "folder", nargs="?", metavar="FOLDER", help="folder of the recordings (the rig's, else the current one)"
    )
    p.add_argument("--rig", type=Path, metavar="rig.toml", help="description of the rig")
    p.add_argument(
        "--emulate", action="store_true", help="no hardware: every run on an emulator with the straw behind it"
    )
    p.add_argument(
        "--listen", default="127.0.0.1:0", metavar="HOST:PORT", help="where to serve (127.0.0.1, any free port)"
    )
    p.add_argument("--remote", action="store_true", help="allow an address in --listen that other machines can reach")
    p.add_argument("--no-browser", action="store_true", help="print the address without opening a browser")

    p = command(
        commands,
        "investigate",
        "diagnose, run the most informative next experiment, and repeat until there is an answer",
    )
    p.add_argument(
        "folder", nargs="?", metavar="FOLDER", help="folder of the recordings (the rig's, else the current one)"
    )
    rig_options(p)
    investigate_options(p)
    straw_options(p, "the base model, whose own constants are refitted")
    json_option(p)

    track_command(commands)
    identify_commands(commands)
    diagnose_command(commands)
    model_commands(commands)
    clock_command(commands)
    replay_command(commands)
    return top


def plug(args: argparse.Namespace) -> None:
    """Register the user's own laws before a command loads the model: those named, and those of the straw file."""
    straw, rig = getattr(args, "straw", None), getattr(args, "rig", None)
    named = [*getattr(args, "laws", [])]
    if isinstance(rig, Path) and straw is None:
        straw = straw_of_rig(rig)
    if isinstance(straw, Path):
        named += laws_named_in(straw)
    if named:
        add_laws(*named)
    if isinstance(straw, Path) and (readers := files_named_in(straw, "readers")):
        from straw.rig.tables.reader import add_readers

        add_readers(*readers)
    figures = [*getattr(args, "figures", []), *(files_named_in(straw, "figures") if isinstance(straw, Path) else [])]
    if figures:
        from straw.replay.metrics.merit import add_figures

        add_figures(*figures)


def main(argv: list[str] | None = None) -> int:
    """Run one command; 0 ok, 1 the answer is no, 2 bad input in one line, 130 interrupted."""
    args = parser().parse_args(argv)
    try:
        plug(args)
        return int(importlib.import_module(f"straw.replay.commands.{args.module}").run(args))
    except USER_ERRORS as error:
        print(f"straw: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("straw: interrupted; what was finished is kept", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has ended, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
