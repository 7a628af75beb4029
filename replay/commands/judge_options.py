"""Options of straw identify, diagnose and replay; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import Parser, command, identified_options, json_option, straw_options, workers_options


def identify_commands(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw identify with its kinds of measurement."""
    identify = commands.add_parser("identify", help="determine constants of a straw from measurements")
    kinds = identify.add_subparsers(title="commands", metavar="COMMAND", required=True)
    p = command(kinds, "filling", "the channel's radius from a table of filling tests", module="identify")
    p.add_argument(
        "table", type=Path, metavar="TABLE.csv", help="columns volume_m3, pressure_difference_pa, filling_time_s"
    )
    identified_options(p)
    p = command(
        kinds, "geometry", "the frusta's zeta_01, zeta_02, h and E from lengths and snap pressures", module="identify"
    )
    for name, text in (
        ("folded-length-mm", "length of a folded cell"),
        ("deployed-length-mm", "length of a deployed cell"),
        ("fold-pressure-kpa", "gauge pressure at which cell 1 folds, all others folded"),
        ("deploy-pressure-kpa", "gauge pressure at which cell 1 deploys, all others deployed"),
    ):
        p.add_argument(f"--{name}", type=float, required=True, metavar="VALUE", help=text)
    p.add_argument(
        "--length-resolution-mm", type=float, default=0.01, metavar="MM", help="resolution of the caliper (0.01)"
    )
    p.add_argument(
        "--pressure-step-kpa",
        type=float,
        default=0.5,
        metavar="KPA",
        help="step in which the pressure was raised (0.5)",
    )
    p.add_argument("--whole-straw", action="store_true", help="let the other cells move with the pressure as well")
    identified_options(p)

    p = command(
        kinds, "runs", "damping c_zeta, c_phi and radius r_ch from recordings, fitted jointly", module="identify"
    )
    p.add_argument("runs", type=Path, nargs="+", metavar="RUN.mcap", help="runs, and tracks derived from them")
    p.add_argument(
        "--each",
        action="store_true",
        help="fit each run by itself as well: constants that differ point to missing physics",
    )
    workers_options(p)
    identified_options(p)


def diagnose_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw diagnose."""
    p = command(
        commands, "diagnose", "find what the model leaves out, or which instrument is wrong, and show the improvement"
    )
    p.add_argument(
        "runs",
        type=Path,
        nargs="+",
        metavar="RUN.mcap",
        help="runs of one specimen and their tracks; with --system, its tables",
    )
    straw_options(p, "the base model, whose own constants are refitted")
    p.add_argument("--system", type=Path, metavar="S.py", help="a system of your own instead of a straw")
    p.add_argument(
        "--hold-out",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="with --system: recordings that no fit sees",
    )
    p.add_argument(
        "--given",
        action="append",
        default=[],
        metavar="C=VALUE,LOW,HIGH",
        help="with --system: a constant known better than the file says",
    )
    p.add_argument(
        "--tolerance",
        metavar="x=0.1mm,phi=2mrad",
        help="RMS misfit that is good enough, by channel or as a share of the motion: 2%%",
    )
    p.add_argument("--report", type=Path, metavar="R.html", help="a page with the verdict and its evidence")
    p.add_argument("-o", "--output", type=Path, metavar="S.toml", help="the improved straw")
    p.add_argument(
        "--experiment",
        type=Path,
        metavar="P.toml",
        help="the protocol that would distinguish the hypotheses that survive",
    )
    p.add_argument(
        "--without", nargs="+", action="extend", default=[], metavar="CAUSE", help="leave causes out of the library"
    )
    workers_options(p)
    p.add_argument("--partial", action="store_true", help="use what is readable of damaged or cut recordings")
    json_option(p)


def replay_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw replay."""
    p = command(commands, "replay", "compare recordings with the model's prediction: metrics and a page")
    p.add_argument("runs", type=Path, nargs="+", metavar="RUN.mcap", help="runs, and tracks derived from them")
    straw_options(p)
    p.add_argument("--figures", type=Path, nargs="+", default=[], metavar="F.py", help="figures of merit of your own")
    p.add_argument("--report", type=Path, default=Path("replay.html"), metavar="R.html", help="the page (replay.html)")
    p.add_argument("--partial", action="store_true", help="use what is readable of damaged or cut recordings")
    p.add_argument(
        "--fitted", nargs="+", default=[], metavar="RUN|JSON", help="runs that went into a fit, or the fit's JSON"
    )
    p.add_argument(
        "--uncertain",
        action="append",
        default=[],
        metavar="NAME=SIGMA",
        help="standard uncertainty of a constant, SI, as r_ch_m=2e-6",
    )
    p.add_argument(
        "--protocol",
        type=Path,
        nargs="?",
        const=Path(),
        metavar="P.toml",
        help="also run the protocol on the emulator and the model, and overlay all three (the recording's own)",
    )
    p.add_argument("--png", type=Path, metavar="P.png", help="the comparison as a figure (png, svg or pdf)")
    p.add_argument("--video", type=Path, nargs="+", metavar="VIDEO", help="the run's video, shown beside the straw")
    p.add_argument("--camera", type=Path, metavar="C.json", help="the camera with its placement (that of the track)")
    p.add_argument(
        "--predictions", type=Path, metavar="DIR", help="write each run's prediction as a recording on the run's clock"
    )
    json_option(p)
