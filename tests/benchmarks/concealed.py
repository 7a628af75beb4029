"""Sealed cases: causes concealed by an independent apparatus, diagnosed, and the labels opened at the end.

    python -m tests.benchmarks.concealed --split develop --seed 1 --cases 20

The SHA-256 of all labels is printed before the first analysis; `--split final` is for the end, with an unused seed. One
line of JSON per case; an interrupted benchmark continues where it stopped, `--score` only scores existing rows.
`--ablate` takes each true cause out of the library: nothing may then be named. `--camera` paints every run as a video
and diagnoses its track. Rows of whole decks are kept in `decks`, named by seed and by the commit that wrote them:
`--out` continues one from a checkout of that commit, `--score` prints its results, `--again` by the present judge.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.options import workers_options
from tests.apparatus.cases import RUN_IDS, Case, Split, deck, generate, opened, recorded, seal
from tests.benchmarks.concealed_film import filmed
from tests.benchmarks.concealed_score import ablated, judged_again, score
from tests.benchmarks.rows import kept, worked_out

#: A campaign of six of the eight runs, to save a quarter of the time.
SIX = ("fold-25kPa", "deploy-35kPa-1", "fold-20kPa-2-5", "staircase", "deploy-35kPa-3", "deploy-30kPa-6")
#: The constants that a user would give: the base constants without a specimen's own scatter.
BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)


def diagnosed(case: Case, ablate: bool = False, camera: bool = False) -> dict[str, Any]:
    """The diagnosis of a case, without access to its label, or without its cause in the library."""
    made = generate(replace(case, runs=SIX) if case.runs == RUN_IDS else case, filmed if camera else recorded)
    library = [name for name in causes(BASE.cells) if not (ablate and name in case.label)]
    start = time.process_time()
    with ThreadPoolExecutor(1) as pool:
        found = inquire([observe(run) for run in made.runs], StrawSystem(BASE), library=library, executor=pool)
        findings = conclude(found, brief=True)
    judgement, held = findings.judgement, findings.held
    return {  # large arrays are rounded
        "name": case.name,
        "verdict": findings.verdict,
        "causes": findings.causes,
        "probability": {name: round(p, 6) for name, p in judgement.probability.items()},
        "left_over": judgement.left_over,
        "excess": {name: round(left, 1) for name, left in judgement.excess.items()},
        "parameters": findings.parameters,
        "before": held.before if held else {},
        "after": held.after if held else {},
        "floor": held.floor if held else {},
        "effect_sigma": made.effect_sigma,
        "cpu_s": time.process_time() - start,
        "failures": found.campaign.tally["failed"],
        "spent": found.spent,
    }


def main() -> None:
    """Seal, diagnose, open, score."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--split", choices=get_args(Split), default="develop")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--cases", type=int, default=10**6)
    ask.add_argument("--only", nargs="+", metavar="NAME", help="these cases, as final-006")
    ask.add_argument("--out", type=Path, help="one line of JSON per case (default: a name by split, seed and way)")
    ask.add_argument("--score", action="store_true", help="diagnose nothing more")
    ask.add_argument("--limit", type=float, metavar="SIGMA2", help="detection limit (default: by the deck's own nulls)")
    ask.add_argument("--again", action="store_true", help="rows of an older version are weighed by the present judge")
    ask.add_argument("--ablate", action="store_true", help="single causes only, each taken out of the library")
    ask.add_argument("--camera", action="store_true", help="painted, filmed and tracked")
    workers_options(ask, "processes")
    args = ask.parse_args()
    ways = [way for way in ("ablate", "camera") if getattr(args, way)]
    # cases of every seed have the same names: in one file they could be mistaken for each other
    path = args.out or Path("-".join(["concealed", args.split, str(args.seed), *ways]) + ".jsonl")
    every = deck(args.split, args.seed)
    sealed = seal(every)
    print(f"{len(every)} cases, labels sealed: {sealed}", flush=True)
    singles = [case for case in every if case.kind in ("single", "instrument")]
    cases = [case for case in (singles if args.ablate else every) if not args.only or case.name in args.only]
    cases = cases[: args.cases]
    told = {row["name"]: row for row in kept(path)}
    todo = {c.name: (c, args.ablate, args.camera) for c in cases if not (args.score or c.name in told)}
    for row in worked_out(todo, diagnosed, path, args.jobs, args.dask):
        told[row["name"]] = row
        print(f"{len(told)} of {len(cases)}", flush=True)
    if args.again:
        told = {name: judged_again(row) for name, row in told.items()}
    assert len(opened(every, sealed)) == len(every)
    print(ablated(cases, told) if args.ablate else score(cases, told, args.limit))


if __name__ == "__main__":
    main()
