"""Sealed cases: effects concealed by an apparatus of other code, diagnosed, and the labels opened at the end.

    python -m tests.benchmarks.concealed --split develop --seed 1 --cases 20 --out concealed.jsonl

The SHA-256 of all labels is printed before the first analysis; `--split final` is for the end, with a seed nobody has
looked at. One line of JSON per case; an interrupted benchmark goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from model.parameters import StrawParameters
from replay.diagnose.diagnosis import inquire
from replay.diagnose.hypothesis import MEASUREMENT
from replay.diagnose.judge import by_cause, surviving
from replay.diagnose.observation import observe
from tests.apparatus.cases import RUN_IDS, Case, deck, generate, opened, seal

#: A campaign of six of the eight runs, to save a quarter of the time.
SIX = ("fold-25kPa", "deploy-35kPa-1", "fold-20kPa-2-5", "staircase", "deploy-35kPa-3", "deploy-30kPa-6")
#: What a user would give: the base constants before a specimen's own scatter.
BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)


def diagnosed(case: Case) -> dict[str, object]:
    """What the diagnosis says of a case, without a look at its label."""
    made = generate(replace(case, runs=SIX) if case.runs == RUN_IDS else case)
    start = time.process_time()
    with ThreadPoolExecutor(1) as pool:
        found = inquire([observe(run) for run in made.runs], BASE, executor=pool)
        judgement = found.judgement()
    return {
        "name": case.name,
        "probability": dict(judgement.probability),
        "left_over": judgement.left_over,
        "effect_sigma": made.effect_sigma,
        "cpu_s": time.process_time() - start,
        "failures": found.campaign.tally["failed"],
    }


def score(cases: list[Case], told: dict[str, dict[str, object]]) -> None:
    """Print how often the answers were right, by kind of case."""
    done = [case for case in cases if case.name in told]
    kinds: dict[str, list[Case]] = {}
    for case in done:
        kinds.setdefault(case.kind, []).append(case)
    wrong = faults_as_physics = 0
    for kind, group in sorted(kinds.items()):
        first = third = survive = 0
        for case in group:
            probability: dict[str, float] = told[case.name]["probability"]  # type: ignore[assignment]
            truth = "+".join(case.label) or "complete"
            ranked = ["+".join(sorted(name.split("+"))) for name in probability]
            causes = list(by_cause(probability))
            if kind in ("null", "unknown"):
                right = ranked[0] == truth
                third += truth in ranked[:3]
            else:
                right = ranked[0] == truth
                third += set(case.label) <= set(causes[: 2 + len(case.label)])
            first += right
            survive += any(set(case.label) <= set(n.split("+")) or n == truth for n in surviving(probability))
            top = next(iter(probability))
            confident = probability[top] >= 0.8 and top not in ("complete", "unknown")
            allowed = {truth, *case.pair}
            if confident and ranked[0] not in allowed and not set(top.split("+")) <= set(case.label):
                wrong += 1
                faults_as_physics += bool(set(case.label) & set(MEASUREMENT)) and not set(top.split("+")) & set(
                    MEASUREMENT
                )
        n = len(group)
        print(f"{kind:<11} {n:>3} cases: first {first}/{n}, among three {third}/{n}, survives {survive}/{n}")
    print(f"confident and wrong: {wrong} of {len(done)}; of them faults taken for physics: {faults_as_physics}")
    cpu = sorted(float(str(told[case.name]["cpu_s"])) for case in done)
    print(f"CPU per case: median {cpu[len(cpu) // 2]:.0f} s, longest {cpu[-1]:.0f} s")


def main() -> None:
    """Seal, diagnose, open, score."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--split", choices=("develop", "final"), default="develop")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--cases", type=int, default=10**6)
    ask.add_argument("--out", type=Path, default=Path("concealed.jsonl"))
    args = ask.parse_args()
    every = deck(args.split, args.seed)
    sealed = seal(every)
    print(f"{len(every)} cases, labels sealed: {sealed}", flush=True)
    cases = every[: args.cases]
    told = {}
    if args.out.exists():
        told = {row["name"]: row for row in map(json.loads, args.out.read_text().splitlines())}
    with ProcessPoolExecutor(2) as pool, args.out.open("a") as out:
        jobs = [pool.submit(diagnosed, case) for case in cases if case.name not in told]
        for job in as_completed(jobs):
            row = job.result()
            told[str(row["name"])] = row
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(f"{len(told)} of {len(cases)}", flush=True)
    assert len(opened(every, sealed)) == len(every)
    score(cases, told)


if __name__ == "__main__":
    main()
