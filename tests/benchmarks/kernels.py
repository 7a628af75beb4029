"""Does a diagnosis depend on the processor? The same campaigns by kernels of OpenBLAS, which round differently.

    python -m tests.benchmarks.kernels [--kernels Haswell Prescott] [--rows FILE] [--write]

Campaigns: those of `../shared/recordings`, where it is there, and ten cases of the opened deck final 20261129, every
fourth from the first. OpenBLAS has a kernel for each family of processors and takes the processor's own unless
OPENBLAS_CORETYPE names another; one that this processor cannot run is left out (SkylakeX needs AVX-512). A row takes
two minutes of a core; rows are kept in a file, and an interrupted run continues.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from straw.replay.options import workers_options
from tests.apparatus.cases import deck
from tests.benchmarks.concealed import BASE, diagnosed
from tests.benchmarks.figures import missed, publish, table, write_option
from tests.benchmarks.rows import Row, kept, worked_out

KERNELS = ("Haswell", "Prescott", "SkylakeX", "Zen")
RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "recordings"
DECK_SEED = 20261129
CASES = tuple(f"final-{number:03d}" for number in range(0, 40, 4))
#: Sigmas by which a constant may differ between kernels: too little to change what anyone concludes from it.
MAY_DIFFER = 0.1
#: Value, sigma, and unit of each constant of each cause.
Constants = Mapping[str, Mapping[str, Mapping[str, Any]]]
HEAD = ("campaign", "verdict", "differs with", "constants differ by at most", "probability differs by")


def main() -> None:
    """Diagnose by every kernel and compare with the first."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument(
        "--kernels", nargs="+", default=KERNELS, metavar="NAME", help="the first is compared with the others"
    )
    ask.add_argument("--rows", type=Path, default=Path("kernels.jsonl"), metavar="FILE", help="kernels.jsonl")
    ask.add_argument("--score", action="store_true", help="diagnose nothing more")
    ask.add_argument("--row", metavar="NAME", help=argparse.SUPPRESS)
    workers_options(ask, "processes")
    write_option(ask)
    args = ask.parse_args()
    if args.row:
        print(json.dumps(row(args.row)))
        return
    kernels = [kernel for kernel in args.kernels if runs(kernel)]
    for kernel in sorted(set(args.kernels) - set(kernels)):
        print(f"{kernel}: this processor cannot run it", flush=True)
    campaigns = [*(path.name for path in sorted(RECORDINGS.glob("open-*"))), *CASES]
    told = {(one["kernel"], one["name"]): one for one in kept(args.rows)}
    asks = [(kernel, name) for name in campaigns for kernel in kernels if (kernel, name) not in told]
    todo = {} if args.score else {f"{name} by {kernel}": (kernel, name) for kernel, name in asks}
    for one in worked_out(todo, asked, args.rows, args.jobs, args.dask):
        told[one["kernel"], one["name"]] = one
        print(f"{one['name']} by {one['kernel']}: {one['verdict']}", flush=True)
    rows = [[told[kernel, name] for kernel in kernels if (kernel, name) in told] for name in campaigns]
    lines = [compared(of_one) for of_one in rows if len(of_one) > 1]
    text = table(HEAD, lines)
    print(text)
    publish("kernels", {"table": text, "run": " and ".join(kernels)}, args.write)


def runs(kernel: str) -> bool:
    """Whether this processor can run a kernel."""
    code = "import numpy as np; np.linalg.inv(np.eye(64))"
    return subprocess.run([sys.executable, "-c", code], env=with_(kernel), check=False).returncode == 0


def with_(kernel: str) -> dict[str, str]:
    """The environment of a process that uses this kernel."""
    return {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}


def asked(kernel: str, name: str) -> Row:
    """The diagnosis of a campaign in a process of its own, as the kernel is chosen when NumPy is loaded."""
    command = [sys.executable, "-m", "tests.benchmarks.kernels", "--row", name]
    said = subprocess.run(command, env=with_(kernel), check=True, capture_output=True, text=True).stdout
    return {"kernel": kernel, **json.loads(said.splitlines()[-1])}


def row(name: str) -> Row:
    """The diagnosis of a campaign: verdict, probabilities, constants."""
    if name in CASES:
        one = diagnosed(next(case for case in deck("final", DECK_SEED) if case.name == name))
        return {key: one[key] for key in ("name", "verdict", "causes", "probability", "parameters")}
    import straw

    found = straw.diagnose(sorted((RECORDINGS / name).glob("*.mcap")), BASE, jobs=1).findings
    probability = {cause: round(p, 6) for cause, p in found.judgement.probability.items()}
    return {
        "name": name, "verdict": found.verdict, "causes": found.causes, "probability": probability,
        "parameters": found.parameters,
    }  # fmt: skip


def compared(rows: Sequence[Row]) -> list[str]:
    """A line of the table: the first row, and how far the others are from it."""
    first, *others = rows
    differs = [
        f"{one['kernel']}: {', '.join(one['causes']) or one['verdict']}"
        for one in others
        if (one["verdict"], set(one["causes"])) != (first["verdict"], set(first["causes"]))
    ]
    sigmas = max((apart(first["parameters"], one["parameters"]) for one in others), default=0.0)
    leads = max(first["probability"], key=first["probability"].__getitem__)
    change = max((abs(one["probability"].get(leads, 0.0) - first["probability"][leads]) for one in others), default=0.0)
    return [
        first["name"], f"{', '.join(first['causes']) or first['verdict']}, {first['probability'][leads]:.2f}",
        missed("; ".join(differs) or "none", not differs), missed(f"{sigmas:.3f} sigma", sigmas <= MAY_DIFFER),
        f"{change:.3f}",
    ]  # fmt: skip


def apart(one: Constants, other: Constants) -> float:
    """Largest difference of a constant of the causes that both name, in sigmas."""
    names = [(cause, name) for cause in set(one) & set(other) for name in set(one[cause]) & set(other[cause])]
    pairs = [(one[cause][name], other[cause][name]) for cause, name in names]
    return max((abs(a["value"] - b["value"]) / a["sigma"] for a, b in pairs if a["sigma"]), default=0.0)


if __name__ == "__main__":
    main()
