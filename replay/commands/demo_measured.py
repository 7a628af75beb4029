"""straw demo --measured: a real recording, a base model, and what the model leaves out."""

from __future__ import annotations

import argparse
import shlex
import shutil
from importlib.resources import as_file, files
from pathlib import Path

from straw.replay.commands import diagnose_system

#: Files copied into the folder, and files made there.
SYSTEM, READINGS, SOURCE = "air_chamber.py", "Ultimaker_015.csv", "SOURCE.md"


def run(args: argparse.Namespace, out: Path) -> int:
    """Diagnose the shipped recording in a folder; 0 whether or not something is missing."""
    from straw.replay.cli import parser  # which imports the commands' options

    with as_file(files("straw.replay.demo.measured")) as shipped:
        for name in (SYSTEM, READINGS, SOURCE):
            shutil.copyfile(shipped / name, out / name)
    print((out / SOURCE).read_text(encoding="utf-8").strip(), end="\n\n")
    command = [
        "diagnose",
        "--system",
        *(str(out / name) for name in (SYSTEM, READINGS)),
        "--report",
        str(out / "why.html"),
    ]
    print(f"straw {shlex.join(command)}\n", flush=True)
    given = ["--json", str(args.json)] if args.json else []
    diagnose_system.run(parser().parse_args([*command, *given]))
    return 0
