"""Options of the commands of the model alone: simulate, paper, shell, design, solid, check, terms."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import Parser, command, json_option, straw_options
from straw.replay.shell.options import design_options, shell_options, solid_options


def simulate_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw simulate."""
    p = command(commands, "simulate", "predict what a straw does under a protocol")
    straw_options(p)
    p.add_argument("--protocol", type=Path, required=True, metavar="P.toml", help="the protocol")
    p.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.mcap", help="the prediction")
    p.add_argument("--from", type=float, dest="start", metavar="S", help="start of the output, s after the run's zero")
    p.add_argument("--to", type=float, dest="end", metavar="S", help="end of the output, likewise")
    json_option(p)


def model_commands(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw paper, shell, design, solid, check and terms."""
    p = command(commands, "paper", "print the paper's numbers beside the model's, and redraw its figures")
    p.add_argument("--out", type=Path, default=Path("paper"), metavar="DIR", help="folder for the figures (paper)")
    p.add_argument(
        "--shell", action="store_true", help="repeat the paper's finite elements as well (Figs. 4 b, c, S2; minutes)"
    )
    p.add_argument(
        "--filling", type=Path, metavar="TABLE.csv", help="filling tests (the shipped sample, which is synthetic)"
    )
    json_option(p)

    p = command(commands, "shell", "compute a frustum or a cell by finite elements, beside equation 7")
    shell_options(p)
    straw_options(p)
    json_option(p)
    p = command(commands, "design", "search for geometries with the snap pressures, lengths and stable states wanted")
    design_options(p)
    straw_options(p, "constants that are not varied")
    json_option(p)
    p = command(commands, "solid", "write the straw as a body for a printer (STL) or a mould (STEP)")
    solid_options(p)
    straw_options(p)

    p = command(commands, "check", "check a law, or another part of your own, against its contract")
    p.add_argument("part", type=Path, metavar="PART.py", help="a LAW, CONTROLLER, READER, FIGURE, or a system")
    p.add_argument("--on", type=Path, metavar="TABLE", help="a table of its logger, for a reader to be tried on")
    p.add_argument("--run", action="store_true", help="run the straw with the law as well: compiles, a minute or two")
    json_option(p)

    p = command(
        commands, "terms", "list the laws that can be added to a straw, and their effect on the paper's two runs"
    )
    json_option(p)
