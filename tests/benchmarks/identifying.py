"""Cost and results of `straw identify runs` on recordings: by exact derivatives, and by another version.

    python -m tests.benchmarks.identifying FOLDER... [--before STRAW]

Each FOLDER holds the runs of one specimen. STRAW is the command `straw` of another version with its own environment,
for example of the last commit that fitted by differences between runs:

    git worktree add /tmp/before 0051f7b~1
    python3 -m venv /tmp/before/.venv && /tmp/before/.venv/bin/python -m pip install -q -e /tmp/before
    python -m tests.benchmarks.identifying ../shared/recordings/open-* --before /tmp/before/.venv/bin/straw

Each is run twice, as the first run compiles; CPU seconds are those of the second.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.benchmarks.figures import publish, table, write_option

#: Factors to the units of the table's head.
UNITS = {"c_zeta_n_s_per_m": 1.0, "c_phi_n_m_s_per_rad": 1e3, "r_ch_m": 1e3}
HEAD = ("runs", "version", "CPU, s", "wall, s", "c_zeta, N s/m", "c_phi, mN m s/rad", "r_ch, mm", "reduced chi²")


def asked(straw: list[str], runs: list[Path]) -> tuple[float, float, dict[str, Any]]:
    """CPU and wall seconds of one command, and its result."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.json"
        before, start = os.times(), time.perf_counter()
        command = [*straw, "identify", "runs", *map(str, runs), "--json", str(out)]
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)
        after, wall_s = os.times(), time.perf_counter() - start
        cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
        return cpu_s, wall_s, json.loads(out.read_text())


def main() -> None:
    """Print a table, and publish it where both versions ran."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--before", type=Path, metavar="STRAW", help="the command of another version")
    write_option(parser)
    parsed = parser.parse_args()
    versions = {"before": [str(parsed.before.resolve())]} if parsed.before else {}
    versions["here"] = [sys.executable, "-m", "straw"]
    lines = []
    for folder in parsed.folder:
        runs = sorted(folder.resolve().glob("*.mcap"))
        for label, straw in versions.items():
            asked(straw, runs[:1])
            cpu_s, wall_s, found = asked(straw, runs)
            lines.append([folder.name, label, f"{cpu_s:.0f}", f"{wall_s:.0f}", *said(found)])
            print(*lines[-1], sep=" | ", flush=True)
    publish("identifying", {"table": table(HEAD, lines)}, parsed.write and parsed.before is not None)


def said(found: dict[str, Any]) -> list[str]:
    """Constants with their intervals, and the reduced chi-square."""
    joint, parts = found["joint"], []
    for name, factor in UNITS.items():
        value, low, high = (joint["constants"][name][key] * factor for key in ("value", "low", "high"))
        parts.append(f"{value:.5g} ({low:.5g} to {high:.5g})")
    return [*parts, f"{joint['reduced_chi2']:.3f}"]


if __name__ == "__main__":
    main()
