"""Time of a default diagnosis of eight runs, of a hard case or of any other.

    python -m tests.benchmarks.hardest [--seed 20261127 --only final-049]

Two causes at once, one of another form than the library's: the search is exhaustive, and ends at its limit of steps or
as unknown, with the curve of the missing law. In threads, as in `straw diagnose`, without the time to read the runs and
draw the page.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ThreadPoolExecutor

from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.cases import deck, generate
from tests.benchmarks.concealed import BASE

SEED, NAME = 20261123, "final-017"


def main() -> None:
    """Diagnose it and print how long it took."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--seed", type=int, default=SEED)
    ask.add_argument("--only", default=NAME, metavar="NAME")
    args = ask.parse_args()
    case = next(case for case in deck("final", args.seed) if case.name == args.only)
    seen = [observe(run) for run in generate(case).runs]
    start = time.perf_counter()
    with ThreadPoolExecutor() as pool:
        found = inquire(seen, StrawSystem(BASE), executor=pool)
        searched_s = time.perf_counter() - start
        findings = conclude(found)
    print(
        f"{len(seen)} runs, {' and '.join(case.label)} concealed: {findings.verdict}, {' and '.join(findings.causes)}"
    )
    tally = found.campaign.tally
    print(f"{time.perf_counter() - start:.0f} s on {os.cpu_count()} cores, {searched_s:.0f} s of it the search")
    print(f"{tally['played']} runs played in {tally['steps'] / 1e6:.1f} million steps")


if __name__ == "__main__":
    main()
