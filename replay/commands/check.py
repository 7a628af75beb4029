"""straw check: the contract test over somebody's own part."""

from __future__ import annotations

import argparse

from straw.replay.diagnose.systems.function.check import defects
from straw.replay.output import write_json


def run(args: argparse.Namespace) -> int:
    """One line for each thing that is wrong; 0 where nothing is, 1 where something is."""
    found = defects(args.part)
    for line in found:
        print(line)
    if not found:
        print(f"{args.part}: a system that can be diagnosed: straw diagnose --system {args.part} DATA.csv ...")
    if args.json:
        write_json(args.json, {"file": str(args.part), "defects": found})
    return 1 if found else 0
