"""Closed loops: rounds, minutes and snaps until `straw investigate` names the cause that an apparatus conceals.

    python -m tests.benchmarks.investigating --split develop --seed 1 --cases 3

The cases are those of `concealed`: the first 40 of a deck hold nulls, one and two causes, causes outside the library
and causes that are hard to distinguish, in random order. The straw on the rig is `tests.apparatus`, which shares no
code with the model; the loop, its diagnosis and its choice are those of the command. Each case is run in four ways:
`loop`; `in_turn` (the campaign's eight runs in their order, diagnosed after each); `random` (random protocols,
diagnosed after each); `fixed` (all eight runs, then one diagnosis). Each case and way gives a row when it is done;
recordings and logs lie beside the rows, and an interrupted case continues from its log. `--split final` is for the end,
with an unused seed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

from straw.replay.options import workers_options
from tests.apparatus.cases import Split, deck, opened, seal
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.investigating_score import figures, score
from tests.benchmarks.investigating_ways import WAYS, investigated
from tests.benchmarks.rows import kept, worked_out


def main() -> None:
    """Seal, investigate, open, score."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--split", choices=get_args(Split), default="develop")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--cases", type=int, default=40)
    ask.add_argument("--only", nargs="+", metavar="NAME", help="these cases, as develop-006")
    ask.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    ask.add_argument("--certainty", type=float, default=0.9, metavar="P", help="as of straw investigate (0.9)")
    ask.add_argument("--rounds", type=int, default=8, metavar="N", help="as of straw investigate (8)")
    ask.add_argument("--out", type=Path, help="one line of JSON per case and way (default: a name by split and seed)")
    ask.add_argument("--score", action="store_true", help="investigate nothing more")
    workers_options(ask, "processes")
    write_option(ask)
    args = ask.parse_args()
    path = args.out or Path(f"investigating-{args.split}-{args.seed}.jsonl")
    every = deck(args.split, args.seed)
    sealed = seal(every)
    print(f"{len(every)} cases, labels sealed: {sealed}", flush=True)
    cases = [case for case in every if not args.only or case.name in args.only][: args.cases]
    told = {(row["name"], row["way"]): row for row in kept(path)}
    todo = {
        f"{case.name} {way}": (case, way, args.certainty, args.rounds, path.with_suffix(""))
        for case in cases
        for way in args.ways
        if not args.score and (case.name, way) not in told
    }
    for row in worked_out(todo, investigated, path, args.jobs, args.dask):
        told[row["name"], row["way"]] = row
        print(f"{row['name']} {row['way']}: {row['reason']}, {row['rounds']} rounds, {row['cpu_s']:.0f} s", flush=True)
    assert len(opened(every, sealed)) == len(every)
    print(score(cases, told, args.ways))
    publish("investigating", figures(cases, told, args.ways), args.write)


if __name__ == "__main__":
    main()
