"""straw demo --measured: a real recording, a base model, and what the model leaves out."""

from __future__ import annotations

import argparse
import shutil
from importlib.resources import as_file, files
from pathlib import Path

from straw.replay.commands import diagnose_system

#: Files copied into the folder, and files made there.
SYSTEM, READINGS, SOURCE = "air_chamber.py", "Ultimaker_015.csv", "SOURCE.md"


def run(args: argparse.Namespace, out: Path) -> int:
    """Diagnose the shipped recording in a folder; 0 whether or not something is missing."""
    with as_file(files("straw.replay.demo.measured")) as shipped:
        for name in (SYSTEM, READINGS, SOURCE):
            shutil.copyfile(shipped / name, out / name)
    print((out / SOURCE).read_text(encoding="utf-8").strip(), end="\n\n")
    print(f"straw diagnose --system {out / SYSTEM} {out / READINGS} --report {out / 'why.html'}\n", flush=True)
    asked = argparse.Namespace(
        system=out / SYSTEM,
        runs=[out / READINGS],
        given=[],
        hold_out=[],
        tolerance=None,
        jobs=2,
        dask=None,
        report=out / "why.html",
        json=args.json,
    )
    diagnose_system.run(asked)
    return 0
