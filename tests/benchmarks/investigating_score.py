"""Scores loops on sealed cases: answers that are right or wrong, and rounds, minutes and snaps until given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.apparatus.cases import Case

Row = Mapping[str, Any]
Rows = Mapping[tuple[str, str], Row]

#: What an end amounts to, best first. Nothing named where something is concealed is a miss: it may be too small to see.
ENDS = ("right", "undecided", "missed", "wrong name")
HEAD = f"{'way':<8} {'cases':>5} {'right':>6} {'undecided':>10} {'missed':>7} {'wrong name':>11}"


def end_of(case: Case, row: Row) -> str:
    """One of `ENDS`; only what is as certain as was asked for is an answer."""
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
    for other in ways:
        both = [c for c in cases if {(c.name, "loop"), (c.name, other)} <= set(told)]
        if other != "loop" and both:
            lines.append(_against(other, [(c, told[c.name, "loop"], told[c.name, other]) for c in both]))
    lines.append("")
    for case in cases:
        rows = [(way, told[case.name, way]) for way in ways if (case.name, way) in told]
        if rows:
            lines.append(f"{case.name} ({case.kind}: {'+'.join(case.label) or 'nothing'})")
            lines += [f"  {way:<8} {end_of(case, r):<10} {_spent(r)}: {r['reason']}, {_named(r)}" for way, r in rows]
    return "\n".join(lines)


def _way(way: str, done: Sequence[tuple[Case, Row]]) -> str:
    ends = [end_of(case, row) for case, row in done]
    counts = [ends.count(end) for end in ENDS]
    line = f"{way:<8} {len(done):>5} {counts[0]:>6} {counts[1]:>10} {counts[2]:>7} {counts[3]:>11}"
    if not done:
        return line
    spent = [_median([row[what] for _, row in done]) for what in ("rounds", "minutes", "snaps")]
    right = [row["rounds"] for (_, row), end in zip(done, ends, strict=True) if end == "right"]
    of_right = f"{_median(right):g}" if right else "-"
    cpu = _median([row["cpu_s"] for _, row in done])
    return f"{line}   {spent[0]:g}, {spent[1]:.2f}, {spent[2]:g}; {of_right}   {cpu:.0f}"


def _against(other: str, both: Sequence[tuple[Case, Row, Row]]) -> str:
    """Costs where both are right, and wrong names that only the loop gives."""
    right = [(mine, theirs) for c, mine, theirs in both if end_of(c, mine) == end_of(c, theirs) == "right"]
    gained = [c for c, mine, theirs in both if end_of(c, mine) == "wrong name" != end_of(c, theirs)]
    line = f"loop against {other}: wrong names gained {len(gained)} of {len(both)}"
    line += f" ({', '.join(c.name for c in gained)})" if gained else ""
    line += f"; both right in {len(right)}"
    for what in ("rounds", "minutes", "snaps"):
        mine, theirs = sum(m[what] for m, _ in right), sum(t[what] for _, t in right)
        if theirs:
            line += f"; {what} {mine:.3g} of {theirs:.3g} ({100 * mine / theirs:.0f} %)"
    return line


def _spent(row: Row) -> str:
    return f"{row['rounds']} rounds, {row['minutes']:.2f} min, {row['snaps']} snaps"


def _named(row: Row) -> str:
    if not row["diagnoses"]:
        return "not diagnosed"
    probability = row["diagnoses"][-1]["probability"]
    return f"{row['verdict']}; " + ", ".join(f"{name} {p:.2f}" for name, p in list(probability.items())[:3])


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))
