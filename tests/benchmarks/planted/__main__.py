"""Laws planted in simulated systems, and none in some, as the search for missing physics finds them.

    python -m tests.benchmarks.planted [NAME ...] [--seeds N] [--rows FILE.jsonl] [--write]

The systems are others than the measured ones (`tests.benchmarks.measured`): what changes the search is judged here as
well, so that it is not fitted to those. Findings are scored as there; from a system of which nothing is missing, any
claim is one too many.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import zlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.read_recordings import recordings_of
from straw.replay.diagnose.systems.function.system import FunctionSystem
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.measured.__main__ import AGREES, agrees
from tests.benchmarks.planted.cases import CASES
from tests.benchmarks.planted.systems import Planted


def found(case: Planted, seed: int, folder: Path) -> SystemFindings:
    """Findings of a system with the noise and inputs of a seed."""
    path = folder / f"{case.name.replace(' ', '_').replace(',', '')}.py"
    path.write_text(case.text)
    model = load_model(path)
    rng = np.random.default_rng([seed, zlib.crc32(case.name.encode())])
    recordings = recordings_of(model, {name: (name, table) for name, table in case.made(rng).items()})
    with ThreadPoolExecutor(1) as pool:
        return SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))


def score(case: Planted, f: SystemFindings) -> str:
    """How the findings compare with what was planted, as one of `AGREES`."""
    if case.effects:
        like: Any = SimpleNamespace(effects=case.effects, nothing=False)
        return agrees(like, f)
    return "yes" if not f.laws else "not told" if f.verdict == "ambiguous" else "no (claims)"


def main() -> None:
    """Print a line for each system and seed, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="systems whose name holds one of these words (all)")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rows", type=Path, metavar="FILE", help="JSON lines, written over")
    write_option(parser)
    args = parser.parse_args()
    if args.write and args.names:
        sys.exit("--write states the figures of all systems: leave out their names")
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for case in CASES:
            if args.names and not any(name in case.name for name in args.names):
                continue
            for seed in range(args.seeds):
                begin = time.process_time()
                f = found(case, seed, Path(scratch))
                after = float(f.discovery.held[-1][0]) / case.noise
                laws = "; ".join(f"{one.law.says}: {one.formula}" for one in f.laws)
                row = {"name": case.name, "seed": seed, "agrees": score(case, f), "after": after}
                row |= {"verdict": f.verdict, "found": laws, "alike": f.alike_places, "forms": list(f.forms)}
                row |= {"refused": f.refused, "seconds": time.process_time() - begin}
                rows.append(row)
                print(f"{case.name:<22} {seed} {row['agrees']:<11} {after:6.2f} {f.verdict:<17} "
                      f"{row['seconds']:3.0f} s  {laws[:150]}", flush=True)  # fmt: skip
    count = Counter(row["agrees"] for row in rows)
    ratio = np.array([row["after"] for row in rows])
    mean = np.exp(np.mean(np.log(ratio)))
    print(f"{len(rows)} systems: {', '.join(f'{word} {count[word]}' for word in AGREES)}; error where nothing was "
          f"fitted within 1.3 of the noise {int(np.sum(ratio < 1.3))} (geometric mean {mean:.2f}); "
          f"{sum(row['seconds'] for row in rows):.0f} s")  # fmt: skip
    counts = {word.replace("(", "").replace(")", "").replace(" ", "-"): str(count[word]) for word in AGREES}
    publish("planted", {"all": str(len(rows)), **counts, "error": f"{mean:.2f}"}, args.write)
    if args.rows:
        args.rows.write_text("".join(json.dumps(row) + "\n" for row in rows))


if __name__ == "__main__":
    main()
