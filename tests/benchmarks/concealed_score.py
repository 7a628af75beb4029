"""Scores sealed cases: how often the diagnosis was right, wrong with confidence, or undecided."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from straw.replay.diagnose.judge import by_cause, surviving, weighed
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.diagnose.verdict import verdict_of
from tests.apparatus.cases import Case

Row = Mapping[str, Any]

#: A verdict with this probability, or a cause named alone, is confident.
CONFIDENT = 0.8
BINS = (0.0, 0.5, 0.8, 0.95, 1.0 + 1e-9)


def score(cases: Sequence[Case], told: Mapping[str, Row], limit: float | None = None) -> str:
    """A report in lines. ``limit``: detection limit, sigmas squared, instead of that of the deck's own nulls."""
    done = [(case, told[case.name]) for case in cases if case.name in told]
    if not done:
        return "no case was diagnosed"
    lines = [f"{len(done)} cases"]
    nulls = [(c, r) for c, r in done if c.kind == "null"]
    # what the refitted base leaves where nothing is concealed: an effect below most of these cannot be detected
    own = float(np.quantile([base_leaves(r) for _, r in nulls], 0.95)) if nulls else 0.0
    limit = own if limit is None else limit
    if nulls:
        alarms = sum(r["verdict"] not in ("complete",) for _, r in nulls)
        named = sum(r["verdict"] in ("missing_physics", "measurement_fault") for _, r in nulls)
        lines += [f"nulls: false alarms {share(alarms, len(nulls))}, of them naming something {named}"]
        lines += [f"95th percentile of what nulls leave the base: {own:.0f} sigma^2; detection limit: {limit:.0f}"]
    for kind in ("single", "instrument", "two", "hard_pair"):
        group = [(c, r) for c, r in done if c.kind == kind]
        above = [(c, r) for c, r in group if base_leaves(r) > limit]
        for what, some in (("all", group), ("above the limit", above)):
            if some:
                counts = [sum(is_so(c, r) for c, r in some) for is_so in (first, _third, _survives)]
                shares = [share(count, len(some)) for count in counts]
                lines.append(
                    f"{kind}, {what}: first {shares[0]}, among three {shares[1]}, in the surviving set {shares[2]}"
                )
    lines += _of_two(done, limit)
    unknown = [(c, r) for c, r in done if c.kind == "unknown"]
    if unknown:
        seen = [(c, r) for c, r in unknown if base_leaves(r) > limit]
        said = sum(r["verdict"] == "unknown_physics" for _, r in seen)
        doubt = sum(r["verdict"] in ("unknown_physics", "ambiguous") for _, r in seen)
        lines.append(f"outside the library, above the limit: unknown {share(said, len(seen))}, or doubt {doubt}")
    misnamed = [(c, r) for c, r in done if wrong(c, r)]
    lines.append(f"confident and wrong: {share(len(misnamed), len(done))}")
    lines += [f"  {c.name}: {_truth(c)} taken for {'+'.join(r['causes'])}" for c, r in misnamed]
    instruments = set(MEASUREMENT)
    physics = sum(bool(set(c.label) & instruments) and not set(r["causes"]) & instruments for c, r in misnamed)
    faults = sum(not set(c.label) & instruments and set(r["causes"]) <= instruments for c, r in misnamed)
    lines.append(f"instrument taken for physics {physics}, physics for instrument {faults}")
    lines += _calibration("calibration", done)
    visible = [(c, r) for c, r in done if c.kind == "null" or base_leaves(r) > limit]
    lines += _calibration("nulls and above the limit", visible)
    lines += _coverage(done)
    lines += _held_out(done)
    lines += _limits(done)
    cpu = sorted(float(r["cpu_s"]) for _, r in done)
    lines.append(f"CPU per case: median {cpu[len(cpu) // 2]:.0f}, mean {np.mean(cpu):.0f}, most {cpu[-1]:.0f} s")
    return "\n".join(lines)


def judged_again(row: Row, cells: int = 9) -> Row:
    """The row with probabilities, verdict and causes by the present judge, from each hypothesis' recorded misfit."""
    own = {name: len(unknowns) for name, (unknowns, _) in causes(cells).items()}
    constants = {n: sum(own[part] for part in n.split("+")) for n in row["excess"] if n != "complete"}
    probability = weighed(row["excess"], constants, MEASUREMENT)
    verdict, named = verdict_of(probability, MEASUREMENT)
    if (
        row["verdict"] != verdict_of(row["probability"], MEASUREMENT)[0]
    ):  # the search had been cut short, which decides nothing
        verdict, named = "ambiguous", [cause for cause in named if cause != "unknown"]
    return {**row, "probability": probability, "verdict": verdict, "causes": named}


def ablated(cases: Sequence[Case], told: Mapping[str, Row]) -> str:
    """A report on cases whose true cause was taken out of the library."""
    done = [(case, told[case.name]) for case in cases if case.name in told]
    verdicts = [str(r["verdict"]) for _, r in done]
    lines = [f"{len(done)} cases without their cause in the library:"]
    lines += [f"  {verdict}: {share(verdicts.count(verdict), len(done))}" for verdict in sorted(set(verdicts))]
    wrong = [(c, r) for c, r in done if r["verdict"] in ("missing_physics", "measurement_fault")]
    lines += [f"  {c.name}: {_truth(c)} taken for {'+'.join(r['causes'])}" for c, r in wrong]
    return "\n".join(lines)


def _of_two(done: Sequence[tuple[Case, Row]], limit: float) -> list[str]:
    """Of cases with two causes: whether both are named, or one, or something else."""
    two = [(c, r) for c, r in done if c.kind == "two"]
    if not two:
        return []
    both, one, needed, other = two_named(two, limit)
    every = len(two)
    return [
        f"two, each needed: both named {share(int(sum(both & needed)), int(sum(needed)))}, one {sum(one & needed)}",
        f"two, all: both named {sum(both)}, one {sum(one)}, something else {share(int(sum(other)), every)}, nothing "
        f"{every - sum(both) - sum(one) - sum(other)}",
    ]


def two_named(two: Sequence[tuple[Case, Row]], limit: float) -> NDArray[np.bool_]:
    """Of cases with two causes, (4, cases): whether both were named; one of them alone; whether both can be, as each
    alone leaves more than the ``limit`` beyond what both leave, or no search fitted both; whether something else was
    named."""
    named = [set(r["causes"]) if r["verdict"] in ("missing_physics", "measurement_fault") else set() for _, r in two]
    rows = [
        (
            some == set(c.label),
            bool(some) and some < set(c.label),
            _each_alone_leaves(c, r) > limit,
            not some <= set(c.label),
        )
        for some, (c, r) in zip(named, two, strict=True)
    ]
    return np.array(rows, dtype=bool).reshape(-1, 4).T


def _each_alone_leaves(case: Case, row: Row) -> float:
    """Misfit of the better of two causes alone beyond both, sigmas squared; infinite if both were never fitted."""
    excess = row["excess"]
    both = next((left for name, left in excess.items() if set(name.split("+")) == set(case.label)), None)
    alone = min((excess[cause] for cause in case.label if cause in excess), default=np.inf)
    if both is None:
        return float(alone if alone < base_leaves(row) else np.inf)
    return float(alone - both)


def _truth(case: Case) -> str:
    return "+".join(case.label) or "complete"


def share(k: int, n: int) -> str:
    """k of n with the 95 % interval of the share (Wilson)."""
    if n == 0:
        return "0/0"
    low, high = binomtest(k, n).proportion_ci(method="wilson")
    return f"{k}/{n} ({100 * k / n:.0f} %, {100 * low:.0f} to {100 * high:.0f})"


def _sorted(name: str) -> str:
    return "+".join(sorted(name.split("+")))


def first(case: Case, row: Row) -> bool:
    return _sorted(next(iter(row["probability"]))) == _truth(case)


def _third(case: Case, row: Row) -> bool:
    if not case.label:
        return "complete" in list(row["probability"])[:3]
    return set(case.label) <= set(list(by_cause(row["probability"]))[: 2 + len(case.label)])


def _survives(case: Case, row: Row) -> bool:
    names = surviving(row["probability"])
    return any(_sorted(n) == _truth(case) or (case.label and set(case.label) <= set(n.split("+"))) for n in names)


def wrong(case: Case, row: Row) -> bool:
    """Whether a cause was named that is not present (of a hard pair either may be named)."""
    if row["verdict"] not in ("missing_physics", "measurement_fault"):
        return False
    return not set(row["causes"]) <= {*case.label, *case.pair}


def base_leaves(row: Row) -> float:
    """Misfit beyond noise that the base model with its own constants refitted leaves, sigmas squared."""
    return float(row["excess"]["complete"])


def _calibration(what: str, done: Sequence[tuple[Case, Row]]) -> list[str]:
    top = np.array([next(iter(r["probability"].values())) for _, r in done])
    right = np.array([first(c, r) for c, r in done])
    out = []
    for low, high in itertools.pairwise(BINS):
        here = (top >= low) & (top < high)
        if here.any():
            told = f"{np.mean(top[here]):.2f} said, {np.mean(right[here]):.2f} right"
            out.append(f"{what}, {low:.2f} to {min(high, 1):.2f}: {told} of {np.count_nonzero(here)}")
    return out


def deviations(done: Sequence[tuple[Case, Row]]) -> NDArray[np.float64]:
    """Error of each constant of an instrument in its standard deviations; these constants agree in both codes."""
    off = []
    for case, row in done:
        for cause in case.truth:
            if cause.name in MEASUREMENT and cause.name in row["parameters"]:
                (found,) = row["parameters"][cause.name].values()
                off.append((abs(found["value"]) - cause.size) / found["sigma"])
    return np.abs(np.array(off))


def _coverage(done: Sequence[tuple[Case, Row]]) -> list[str]:
    z = deviations(done)
    counts = [int(np.sum(z < k)) for k in (1, 2, 3)]
    return [f"instruments' constants within 1, 2, 3 sigma: {counts} of {len(z)}"] if len(z) else []


def held_out(done: Sequence[tuple[Case, Row]]) -> NDArray[np.float64]:
    """RMS of X on held-out runs where a cause was named: before, after, and the noise, m, (3, cases)."""
    rows = [
        r for _, r in done if r["verdict"] in ("missing_physics", "measurement_fault") and r["causes"] and r["before"]
    ]
    return np.array([[r[k]["x_m"] for k in ("before", "after", "floor")] for r in rows]).reshape(-1, 3).T


def improved(held: NDArray[np.float64]) -> int:
    """How many of `held_out` became three times smaller or came near the noise."""
    before, after, floor = held
    return int(np.count_nonzero((after < before / 3) | (after < 1.3 * floor)))


def _held_out(done: Sequence[tuple[Case, Row]]) -> list[str]:
    held = held_out(done)
    if not held.shape[1]:
        return []
    medians = ", ".join(f"{1e3 * np.median(v):.3f}" for v in held)
    good = f"{improved(held)}/{held.shape[1]}"
    return [f"held out, X, median before, after, floor: {medians} mm; 3 times better or near noise {good}"]


def _limits(done: Sequence[tuple[Case, Row]]) -> list[str]:
    """By cause: each size, its effect in the runs that show it most (sigma), and the verdict."""
    rows: dict[str, list[tuple[float, str]]] = {}
    for case, row in done:
        if len(case.truth) == 1 and case.kind in ("single", "instrument", "unknown"):
            name = case.truth[0].form if case.kind == "unknown" else case.truth[0].name
            said = "+".join(row["causes"]) or row["verdict"]
            right = "right" if first(case, row) else said
            strong = max(row["effect_sigma"].values())
            rows.setdefault(name, []).append((case.truth[0].size, f"{case.truth[0].size:.3g} ({strong:.0f} s) {right}"))
    return [f"  {name}: {'; '.join(text for _, text in sorted(some))}" for name, some in sorted(rows.items())]
