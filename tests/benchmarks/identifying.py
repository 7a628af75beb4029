"""Cost and results of `straw identify runs` on recordings: by exact derivatives, and by a checkout with others.

    python -m tests.benchmarks.identifying FOLDER... [--before TREE]

Each FOLDER holds the runs of one specimen. TREE is another checkout of this project, for example of the last commit
that fitted by differences between runs: git worktree add /tmp/before 0051f7b~1. Each is run twice, as the first run
compiles; CPU seconds are those of the second.
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

HERE = Path(__file__).resolve().parents[2]
ASK = "import sys; sys.path.insert(0, sys.argv[1]); from straw.replay.cli import main; sys.exit(main(sys.argv[2:]))"
UNITS = {"c_zeta_n_s_per_m": (1.0, "N s/m"), "c_phi_n_m_s_per_rad": (1e3, "mN m s/rad"), "r_ch_m": (1e3, "mm")}


def asked(tree: Path, runs: list[Path]) -> tuple[float, float, dict[str, Any]]:
    """CPU and wall seconds of one command, and its result."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.json"
        command = [sys.executable, "-c", ASK, str(tree), "identify", "runs", *map(str, runs), "--json", str(out)]
        before, start = os.times(), time.perf_counter()
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=tree)
        after, wall_s = os.times(), time.perf_counter() - start
        cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
        return cpu_s, wall_s, json.loads(out.read_text())


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--before", type=Path, metavar="TREE")
    parsed = parser.parse_args()
    trees = [("before", parsed.before.resolve())] if parsed.before else []
    for folder in parsed.folder:
        runs = sorted(folder.resolve().glob("*.mcap"))
        for label, tree in [*trees, ("here", HERE)]:
            asked(tree, runs[:1])
            cpu_s, wall_s, found = asked(tree, runs)
            print(f"{folder.name:<10}{label:<8}{cpu_s:>7.1f} s CPU{wall_s:>7.1f} s  {said(found)}", flush=True)


def said(found: dict[str, Any]) -> str:
    """Constants with their intervals and the misfit."""
    joint, parts = found["joint"], []
    for name, (factor, unit) in UNITS.items():
        value, low, high = (joint["constants"][name][key] * factor for key in ("value", "low", "high"))
        parts.append(f"{value:.5g} ({low:.5g} to {high:.5g}) {unit}")
    return f"{'; '.join(parts)}; chi2 {joint['reduced_chi2']:.3f}"


if __name__ == "__main__":
    main()
