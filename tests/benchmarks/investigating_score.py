"""Scores loops on sealed cases: right and wrong answers, and the rounds, minutes and snaps they took."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.apparatus.cases import Case
from tests.benchmarks.figures import table

Row = Mapping[str, Any]
Rows = Mapping[tuple[str, str], Row]

#: Outcomes, best first. No cause named where one is concealed is a miss: it may be too small to detect.
ENDS = ("right", "undecided", "missed", "wrong name")
SPENT = ("rounds", "minutes", "snaps")
HEAD = f"{'way':<8} {'cases':>5} {'right':>6} {'undecided':>10} {'missed':>7} {'wrong name':>11}"


def end_of(case: Case, row: Row) -> str:
    """One of `ENDS`; only a finding with the required certainty is an answer."""
    if row["reason"] == "named":
        return "right" if set(row["causes"]) <= set(case.label) else "wrong name"
    if row["reason"] == "complete":
        return "missed" if case.label else "right"
    if row["reason"] == "unknown" and case.label == ("unknown",):
        return "right"
    return "undecided"


def score(cases: Sequence[Case], told: Rows, ways: Sequence[str]) -> str:
    """A report in lines: each case, each way, and the loop against every other way on the cases that both did."""
    lines = [f"{HEAD}   rounds, minutes, snaps (median; of those that are right: rounds)   CPU/s"]
    lines += [_way(way, [(c, told[c.name, way]) for c in cases if (c.name, way) in told]) for way in ways]
    compared = {other: against(other, cases, told) for other in ways if other != "loop"}
    lines += [_against(other, one) for other, one in compared.items() if one.both]
    lines.append("")
    for case in cases:
        rows = [(way, told[case.name, way]) for way in ways if (case.name, way) in told]
        if rows:
            lines.append(f"{case.name} ({case.kind}: {'+'.join(case.label) or 'nothing'})")
            lines += [f"  {way:<8} {end_of(case, r):<10} {_spent(r)}: {r['reason']}, {_named(r)}" for way, r in rows]
    return "\n".join(lines)


def figures(cases: Sequence[Case], told: Rows, ways: Sequence[str]) -> dict[str, str]:
    """Tables for the README: what each way came to, and the loop's costs over each other way's."""
    done = {way: [(c, told[c.name, way]) for c in cases if (c.name, way) in told] for way in ways}
    head = ["way", "cases", *ENDS, "runs", "minutes", "snaps", "CPU, s"]
    each = [[way, str(len(rows)), *map(str, _ends(rows)), *_medians(rows)] for way, rows in done.items() if rows]
    over = [
        [f"loop over {other}", str(one.both), str(one.right), str(len(one.gained)), *map(_share, one.spent.values())]
        for other in ways
        if other != "loop" and (one := against(other, cases, told)).both
    ]
    costs = ["", "cases", "both right", "wrong names gained", "runs", "minutes", "snaps"]
    return {"ways": table(head, each), "costs": table(costs, over)}


def _ends(done: Sequence[tuple[Case, Row]]) -> list[int]:
    ends = [end_of(case, row) for case, row in done]
    return [ends.count(end) for end in ENDS]


def _medians(done: Sequence[tuple[Case, Row]]) -> list[str]:
    rounds, minutes, snaps, cpu = (_median([row[what] for _, row in done]) for what in (*SPENT, "cpu_s"))
    return [f"{rounds:g}", f"{minutes:.2f}", f"{snaps:g}", f"{cpu:.0f}"]


def _way(way: str, done: Sequence[tuple[Case, Row]]) -> str:
    counts = _ends(done)
    line = f"{way:<8} {len(done):>5} {counts[0]:>6} {counts[1]:>10} {counts[2]:>7} {counts[3]:>11}"
    if not done:
        return line
    *spent, cpu = _medians(done)
    right = [row["rounds"] for case, row in done if end_of(case, row) == "right"]
    return f"{line}   {', '.join(spent)}; {f'{_median(right):g}' if right else '-'}   {cpu}"


@dataclass(frozen=True)
class Against:
    """The loop beside another way on the cases that ``both`` did: cases in which both are ``right``, what was ``spent``
    there by (loop, other), and cases in which only the loop gives a wrong name."""

    both: int
    right: int
    spent: Mapping[str, tuple[float, float]]
    gained: Sequence[str]


def against(other: str, cases: Sequence[Case], told: Rows) -> Against:
    """The loop beside another way."""
    both = [(c, told[c.name, "loop"], told[c.name, other]) for c in cases if _both(c, other, told)]
    right = [(mine, theirs) for c, mine, theirs in both if end_of(c, mine) == end_of(c, theirs) == "right"]
    gained = [c.name for c, mine, theirs in both if end_of(c, mine) == "wrong name" != end_of(c, theirs)]
    spent = {what: (sum(m[what] for m, _ in right), sum(t[what] for _, t in right)) for what in SPENT}
    return Against(len(both), len(right), spent, gained)


def _both(case: Case, other: str, told: Rows) -> bool:
    return {(case.name, "loop"), (case.name, other)} <= set(told)


def _against(other: str, one: Against) -> str:
    line = f"loop against {other}: wrong names gained {len(one.gained)} of {one.both}"
    line += f" ({', '.join(one.gained)})" if one.gained else ""
    costs = "; ".join(f"{what} {_share(spent)}" for what, spent in one.spent.items())
    return f"{line}; both right in {one.right}; {costs}"


def _share(spent: tuple[float, float]) -> str:
    mine, theirs = spent
    return f"{mine:.3g} of {theirs:.3g}" + (f" ({100 * mine / theirs:.0f} %)" if theirs else "")


def _spent(row: Row) -> str:
    return f"{row['rounds']} rounds, {row['minutes']:.2f} min, {row['snaps']} snaps"


def _named(row: Row) -> str:
    if not row["diagnoses"]:
        return "not diagnosed"
    probability = row["diagnoses"][-1]["probability"]
    return f"{row['verdict']}; " + ", ".join(f"{name} {p:.2f}" for name, p in list(probability.items())[:3])


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))
