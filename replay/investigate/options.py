"""Options of straw investigate; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import whole_number, workers_options


def investigate_options(p: argparse.ArgumentParser) -> None:
    """When to stop, who approves, what is emulated, and how the diagnosis is done."""
    p.add_argument("--specimen", metavar="NAME", help="which straw (the only one in the folder)")
    p.add_argument(
        "--certainty", type=float, default=0.9, metavar="P", help="probability at which an answer is accepted (0.9)"
    )
    p.add_argument(
        "--tolerance", metavar="x=0.1mm,phi=2mrad", help="RMS misfit that is good enough, as in straw diagnose"
    )
    p.add_argument("--rounds", type=int, default=8, metavar="N", help="largest number of experiments (8)")
    p.add_argument("--minutes", type=float, metavar="M", help="longest time of driving the rig")
    p.add_argument("--snaps", type=int, metavar="N", help="largest number of snaps")
    p.add_argument(
        "--yes", type=whole_number, default=0, metavar="N", help="approve N rounds that need no work by hand (0)"
    )
    p.add_argument("--wait", action="store_true", help="wait for approval on the lab's page, or by --answer")
    p.add_argument("--answer", choices=("yes", "no"), help="answer the loop that waits in this folder, and end")
    p.add_argument("--log", type=Path, metavar="L.jsonl", help="its log, to continue from (investigate-SPECIMEN.jsonl)")
    p.add_argument("--operator", default="", metavar="NAME", help="who approves, for the record")
    p.add_argument("--fast", action="store_true", help="with --emulate: as fast as possible instead of in real time")
    p.add_argument("--twin", type=Path, metavar="T.toml", help="with --emulate: the emulated straw, if unlike --straw")
    p.add_argument(
        "--without", nargs="+", action="extend", default=[], metavar="CAUSE", help="leave causes out of the library"
    )
    workers_options(p)
