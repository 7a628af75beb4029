"""Diagnosis of an apparatus whose straw has walls by finite elements, or another concealed cause.

    python -m tests.benchmarks.concealed_walls [--share 1.0] [--other NAME=SIZE] [--seed 21] [--runs 2]
        [--library all|NAME,NAME]

No deck draws this cause (`tests.apparatus.effects.BESIDE`). With a share of 0 and no other cause nothing is concealed:
with the whole library, walls must then not be named. One core.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import campaign
from tests.apparatus.effects import EVERY, Cause
from tests.benchmarks.concealed import BASE, SIX


def other(text: str) -> Cause:
    """NAME=SIZE as a cause in its first form."""
    name, _, size = text.partition("=")
    if name not in EVERY or not size:
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=SIZE, NAME one of {', '.join(EVERY)}")
    return Cause(name, float(size), next(iter(EVERY[name].forms)))


def main() -> None:
    """Record, diagnose, print verdict, probabilities and constants."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--share", type=float, default=1.0)
    ask.add_argument("--other", type=other, metavar="NAME=SIZE", help="a cause concealed beside the walls' share")
    ask.add_argument("--seed", type=int, default=21)
    ask.add_argument("--runs", type=int, default=2)
    ask.add_argument("--library", default="wall_elasticity,crease_stiffness")
    args = ask.parse_args()
    truth = (Cause("wall_elasticity", args.share, "finite elements"),) if args.share else ()
    truth += (args.other,) if args.other else ()
    seen = [observe(run) for run in campaign(truth, args.seed, SIX[: args.runs])]
    library = None if args.library == "all" else tuple(args.library.split(","))
    start = time.process_time()
    with ThreadPoolExecutor(1) as pool:
        findings = conclude(inquire(seen, StrawSystem(BASE), library=library, executor=pool), brief=True)
    judgement = findings.judgement
    beside = f" and {args.other.name} of {args.other.size:g}" if args.other else ""
    print(f"share {args.share:g}{beside}, seed {args.seed}, {args.runs} runs: {findings.verdict} {findings.causes}")
    print("probability", {name: round(p, 4) for name, p in judgement.probability.items()})
    print("excess", {name: round(left, 1) for name, left in judgement.excess.items()})
    print("constants", findings.parameters, f"\nCPU {time.process_time() - start:.0f} s")


if __name__ == "__main__":
    main()
