"""Options that several commands share, and how a command is registered; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """Reports an error of the command line in one line."""

    def error(self, message: str) -> NoReturn:
        """Exit 2 with one line."""
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


class VersionAction(argparse.Action):
    """Prints the version, and in a clone the commit; both are looked up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        """Print it and exit."""
        from straw.rig.provenance import version_line

        print(version_line())
        parser.exit()


def rig_options(p: argparse.ArgumentParser) -> None:
    """Which rig, or an emulated one."""
    p.add_argument("--rig", type=Path, metavar="rig.toml", help="description of the rig; options override it")
    where = p.add_mutually_exclusive_group()
    where.add_argument("--port", metavar="URL", help="serial port, by-id path, or socket://host:port")
    where.add_argument("--emulate", action="store_true", help="no hardware: an emulator with the straw behind it")
    controller_options(p, None)


def controller_options(p: argparse.ArgumentParser, default: str | None = "ob1-mk4") -> None:
    """Which controller, and its settings."""
    p.add_argument(
        "--controller", default=default, metavar="NAME", help="ob1-mk4 (default), ob1-sdk, alicat, or a file D.py"
    )
    p.add_argument(
        "--limits", metavar="MIN,MAX[,RATE]", help="limits in kPa and kPa/s that nothing overrides: --limits=-40,60,50"
    )
    p.add_argument(
        "--setting", action="append", default=[], metavar="KEY=VALUE", help="setting of the driver, as unit=B"
    )


def port_option(p: argparse.ArgumentParser) -> None:
    """Where a controller is."""
    p.add_argument("--port", metavar="URL", help="serial port, by-id path, or socket://host:port (all known)")
    p.add_argument(
        "--controller",
        metavar="NAME",
        help="ob1-mk4, ob1-sdk, alicat or D.py (as driven there before, or ob1-mk4)",
    )
    p.add_argument(
        "--setting", action="append", default=[], metavar="KEY=VALUE", help="setting of the driver, as unit=B"
    )
    p.set_defaults(action=p.prog.split()[-1], limits=None)
    json_option(p)


def about_options(p: argparse.ArgumentParser) -> None:
    """What is to be known of a run."""
    p.add_argument("--operator", default="", metavar="NAME", help="who runs it, for the record")
    p.add_argument("--note", action="append", default=[], metavar="TEXT", help="a note for the record; may repeat")
    p.add_argument("--tag", action="append", default=[], metavar="TAG", help="a tag, as by straw runs tag; may repeat")
    p.add_argument("--meta", action="append", default=[], metavar="KEY=VALUE", help="any other fact, for the record")


def whole_number(text: str) -> int:
    """A whole number, zero or above."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text}: expected a whole number, zero or above")
    return int(text)


def one_or_more(text: str) -> int:
    """A whole number, one or above."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: expected a whole number, one or above")
    return int(text)


def command(
    commands: argparse._SubParsersAction[Parser], name: str, text: str, module: str | None = None
) -> argparse.ArgumentParser:
    """Register a command; ``module`` of `straw.replay.commands` runs it."""
    made = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    made.set_defaults(module=module or name)
    return made


def straw_options(p: argparse.ArgumentParser, text: str = "the straw") -> None:
    """Which straw, with laws of one's own."""
    p.add_argument(
        "--straw", type=Path, metavar="S.toml", help=f"{text}; the file holds constants that differ from the paper's"
    )
    p.add_argument(
        "--laws",
        type=Path,
        nargs="+",
        default=[],
        metavar="L.py",
        help="laws of your own, beside those that the straw file names",
    )


def identified_options(p: argparse.ArgumentParser) -> None:
    """What every kind of identification takes."""
    p.add_argument("-o", "--output", type=Path, metavar="OUT.toml", help="the straw with the constants found")
    straw_options(p, "constants known otherwise")
    json_option(p)
    p.set_defaults(kind=p.prog.split()[-1])


def workers_options(p: argparse.ArgumentParser, kind: str = "threads") -> None:
    """Where the work is done."""
    p.add_argument("--jobs", type=one_or_more, default=2, metavar="N", help=f"{kind} (2)")
    p.add_argument("--dask", metavar="ADDRESS", help="a Dask scheduler to send the work to")


def json_option(p: argparse.ArgumentParser) -> None:
    """The result for machines."""
    p.add_argument("--json", type=Path, metavar="FILE", help="the result as JSON")
