"""How long a diagnosis of eight runs takes, on the cores of this machine: cases of an opened deck, one after another.

    python -m tests.benchmarks.diagnosing

Nothing else may run meanwhile. Findings are those of `straw diagnose` without the curve of an unknown cause and without
the next experiment.
"""

from __future__ import annotations

import argparse
import statistics
import time
from concurrent.futures import ThreadPoolExecutor

from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.options import one_or_more
from tests.apparatus.cases import Case, deck, generate, recorded
from tests.benchmarks.concealed import BASE
from tests.benchmarks.figures import missed, publish, table, write_option

SEED = 20261130
HEAD = ("case", "concealed", "verdict", "most probable", "wall, s", "CPU, s")
#: Asked of eight runs on two idle cores: the median, and the longest.
MEDIAN_S, LONGEST_S = 60.0, 180.0


def timed(case: Case, jobs: int) -> tuple[list[str], float]:
    """A line of the table, and the wall time."""
    runs = [observe(run) for run in generate(case, recorded).runs]
    wall_s, cpu_s = time.monotonic(), time.process_time()
    with ThreadPoolExecutor(jobs) as pool:
        found = inquire(runs, StrawSystem(BASE), executor=pool)
        findings = conclude(found, brief=True)
    wall_s, cpu_s = time.monotonic() - wall_s, time.process_time() - cpu_s
    names, probability = ", ".join(case.label) or "nothing", findings.judgement.probability
    best = max(probability, key=lambda name: probability[name])
    words = (f"{SEED}-{case.name[-3:]}", names, findings.verdict, f"{best} {probability[best]:.2f}")
    return [*(word.replace("_", " ") for word in words), f"{wall_s:.0f}", f"{cpu_s:.0f}"], wall_s


def main() -> None:
    """Print the table, and publish it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=one_or_more, default=14, metavar="N", help="every Nth case of the deck (14)")
    parser.add_argument("--jobs", type=one_or_more, default=2, metavar="N", help="threads (2)")
    write_option(parser)
    args = parser.parse_args()
    cases = deck("final", SEED)[:: args.every]
    timed(next(case for case in deck("final", SEED) if case.kind == "null"), args.jobs)  # compiles
    lines, walls = [], []
    for case in cases:
        line, wall_s = timed(case, args.jobs)
        lines.append(line)
        walls.append(wall_s)
        print(*line, sep=" | ", flush=True)
    median, longest = statistics.median(walls), max(walls)
    figures = {
        "table": table(HEAD, lines),
        "median": missed(f"{median:.0f}", median <= MEDIAN_S),
        "longest": missed(f"{longest:.0f}", longest <= LONGEST_S),
    }
    print(f"median {figures['median']} s, longest {figures['longest']} s")
    publish("diagnosing", figures, args.write)


if __name__ == "__main__":
    main()
