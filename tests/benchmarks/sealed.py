"""The tables of decks in README.md, from the rows kept in `decks`: when each was opened, and by the present search.

    python -m tests.benchmarks.sealed [--write]

It also prints how far constants of instruments were off, by which `ONE_DEVIATION` was chosen, how many single causes
the later search lost and found, and in how many pairs one cause leads (`LEADS`).

A file is named SPLIT-SEED-COMMIT.jsonl by its deck and the commit whose search made it (`python -m
tests.benchmarks.concealed` makes it); of a deck that was run again there is a second one, with a part of the cases.
"Above the limit" are cases in which the base leaves more than `LIMIT`.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from straw.replay.diagnose.coarse_search import LEADS
from straw.replay.diagnose.settings import ONE_DEVIATION
from tests.apparatus.cases import Case, deck
from tests.benchmarks.concealed_score import (
    BINS,
    base_leaves,
    deviations,
    first,
    held_out,
    improved,
    judged_again,
    two_named,
    wrong,
)
from tests.benchmarks.figures import publish, table, write_option

DECKS = Path(__file__).with_name("decks")
#: Squared sigmas that the base leaves of all but 5 % of the cases in which nothing is concealed (deck final-20261129).
LIMIT = 153.0
HEAD = (
    "deck, commit", "cases", "nothing: complete", "one cause: most probable", "two: both, one named",
    "not in the library: unknown", "confident and wrong", "held out", "instruments within 1, 2, 3 sd", "CPU, s",
)  # fmt: skip

#: The commits whose searches ran a part of these decks again; of a deck that several ran, the last counts.
LATER = ("1327f1c", "23d8230")
SAID = ("decks, judge", "up to 0.5", "0.5 to 0.8", "0.8 to 0.95", "above 0.95")

Rows = Sequence[tuple[Case, Mapping[str, Any]]]


def main() -> None:
    """Print the tables."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    write_option(ask)
    args = ask.parse_args()
    paths = sorted(DECKS.glob("*.jsonl"), key=lambda path: path.name.split("-")[1])
    opened = {_deck(path): path for path in paths if not path.stem.endswith(LATER)}
    again = {_deck(path): path for commit in LATER for path in paths if path.stem.endswith(commit)}
    then = {name: told(path, again=False) for name, path in opened.items()}
    judged = {name: told(path, again=True) for name, path in opened.items()}
    present = {name: told(path, again=True) for name, path in again.items()}
    lines = []
    for name, done in present.items():
        again_run = {case.name for case, _ in done}
        same = [(case, row) for case, row in judged[name] if case.name in again_run]
        lines += [[_named(opened[name]), *line(same)], [_named(again[name]), *line(done)]]
    tables = {
        "opened": table(HEAD, [[_named(opened[name]), *line(done)] for name, done in then.items()]),
        "present": table(HEAD, lines),
        "reliability": table(SAID, [
            ["when opened", *reliability(then)],
            ["the same, by the present judge", *reliability(judged)],
            ["by the later search and the present judge", *reliability(present)],
        ]),
    }  # fmt: skip
    print(*(f"{name}{text}" for name, text in tables.items()), sep="\n")
    for decks, when in ((judged, "opened"), (present, "again")):
        print(*(f"{name} {when}: {scatter(done)}" for name, done in decks.items() if scatter(done)), sep="\n")
    pairs = [pair for name, done in present.items() for pair in _both_ran(judged[name], done)]
    changed = f"lost {sum(a and not b for a, b in pairs)}, found {sum(b and not a for a, b in pairs)}"
    print(f"single causes that both searches ran: {len(pairs)}, first in {sum(a for a, _ in pairs)}; {changed}")
    latest = {(name, case.name): (case, row) for decks in (judged, present) for name, done in decks.items()
              for case, row in done}  # fmt: skip
    leads = [led(case, row) for case, row in latest.values() if case.kind == "two" and base_leaves(row) > LIMIT]
    print(f"pairs of which one cause leaves less than {LEADS:g} of the base's misfit: {sum(leads)} of {len(leads)}")
    publish("sealed", tables, args.write)


def told(path: Path, again: bool) -> Rows:
    """A deck's cases with their findings, by the judge of its commit or by the present one."""
    split, seed, _ = path.stem.split("-")
    rows = {row["name"]: row for row in map(json.loads, path.read_text(encoding="utf-8").splitlines())}
    cases = [case for case in deck(split, int(seed)) if case.name in rows]  # type: ignore[arg-type]
    return [(case, judged_again(rows[case.name]) if again else rows[case.name]) for case in cases]


def line(done: Rows) -> list[str]:
    """A deck's row without its name."""
    above = [(c, r) for c, r in done if base_leaves(r) > LIMIT]
    nulls = [r for c, r in done if c.kind == "null"]
    one = [(c, r) for c, r in above if c.kind in ("single", "instrument")]
    both, single, needed, _ = two_named([(c, r) for c, r in done if c.kind == "two"], LIMIT)
    outside = [r for c, r in above if c.kind == "unknown"]
    held, off = held_out(done), deviations(done)
    cpu = [float(r["cpu_s"]) for _, r in done]
    return [
        str(len(done)),
        _of(sum(r["verdict"] == "complete" for r in nulls), len(nulls)),
        _of(sum(first(c, r) for c, r in one), len(one)),
        f"{sum(both & needed)}, {sum(single & needed)} of {sum(needed)}" if needed.any() else "",
        _of(sum(r["verdict"] == "unknown_physics" for r in outside), len(outside)),
        _of(sum(wrong(c, r) for c, r in done), len(done)),
        _of(improved(held), held.shape[1]),
        f"{', '.join(str(int(np.sum(off < k))) for k in (1, 2, 3))} of {len(off)}" if len(off) else "",
        f"{np.median(cpu):.0f}, {np.mean(cpu):.0f}, {max(cpu):.0f}",
    ]


def _both_ran(then: Rows, now: Rows) -> list[tuple[bool, bool]]:
    """Whether each single cause above the limit by both searches is the most probable by the one and by the other."""
    before = {case.name: (case, row) for case, row in then}
    pairs = [(before[case.name], (case, row)) for case, row in now if case.name in before]
    single = [pair for pair in pairs if pair[0][0].kind in ("single", "instrument")]
    return [(first(*a), first(*b)) for a, b in single if min(base_leaves(a[1]), base_leaves(b[1])) > LIMIT]


def led(case: Case, row: Mapping[str, Any]) -> bool:
    """Whether one cause of a pair alone leaves less than `LEADS` of what the base leaves."""
    return min(row["excess"].get(cause, np.inf) for cause in case.label) < LEADS * base_leaves(row)


def scatter(done: Rows) -> str:
    """What `ONE_DEVIATION` would have to be for instruments' constants of right answers to be as far off as stated."""
    off = deviations([(c, r) for c, r in done if first(c, r)])
    if not len(off):
        return ""
    return f"{len(off)} constants, {ONE_DEVIATION * np.mean(off**2):.2g} squared sigmas are one deviation"


def reliability(decks: Mapping[str, Rows]) -> list[str]:
    """By stated probability of the first hypothesis: its mean, and how often it was right, with nothing concealed
    or above the limit."""
    seen = [(c, r) for done in decks.values() for c, r in done if c.kind == "null" or base_leaves(r) > LIMIT]
    top = np.array([next(iter(r["probability"].values())) for _, r in seen])
    right = np.array([first(c, r) for c, r in seen])
    out = []
    for low, high in itertools.pairwise(BINS):
        here = (top >= low) & (top < high)
        out.append(
            f"{np.mean(top[here]):.2f}: {_of(int(np.sum(right[here])), int(np.sum(here)))}" if here.any() else ""
        )
    return out


def _deck(path: Path) -> str:
    return path.stem.rpartition("-")[0]


def _named(path: Path) -> str:
    split, seed, commit = path.stem.split("-")
    return f"{split} {seed}, {commit}"


def _of(k: int, n: int) -> str:
    return f"{k} of {n}" if n else ""


if __name__ == "__main__":
    main()
