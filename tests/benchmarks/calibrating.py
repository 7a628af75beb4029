"""Calibrates the judge: the maximum-likelihood constants given the known causes of sealed campaigns.

    python -m tests.benchmarks.calibrating tests/benchmarks/decks/final-20261129-ef3c4eb.jsonl --write
    python -m tests.benchmarks.calibrating SPLIT-SEED-COMMIT.jsonl --tell

Rows are those of `python -m tests.benchmarks.concealed`, each file named by its deck; of a case in two files the later
counts. Campaigns in which the base leaves no more than noise (`--limit`) carry no information and are left out, except
those with nothing concealed. `--tell` fits nothing: it evaluates the present constants on a deck that was not used to
find them. `--only second directions` fits these and keeps the others; `--two 0.2` weighs campaigns so that those with
two causes make up this share.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import straw.replay.diagnose.judge
from straw.replay.diagnose.judge import CALIBRATION, Calibration, weighed
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT
from straw.replay.diagnose.systems.straw.library import causes
from tests.apparatus.cases import Case, deck

Rows = Sequence[tuple[Case, Mapping[str, Any]]]
#: Prior mean of each constant, and its deviation: of the logarithm, or of log priors themselves.
GUESS = Calibration(
    scale=20, cause=4, second=4, constant=0.5, unknown=6, other=0.2, other_fault=0.1, form=0.01, power=1.5,
    chance=0.003, second_chance=0.003, directions=4, missed=0.05,
)  # fmt: skip
OFF = Calibration(
    scale=1,
    cause=3,
    second=3,
    constant=1,
    unknown=3,
    other=1,
    other_fault=1,
    form=1.5,
    power=0.5,
    chance=1,
    second_chance=1,
    directions=0.7,
    missed=1.5,
)
LOGARITHMIC = ("scale", "other", "other_fault", "form", "power", "chance", "second_chance", "directions", "missed")
#: Misfit, sigmas squared, above which one of two causes alone does not suffice: what noise leaves of a base.
ALONE = 150.0
#: Largest probability, since a factor on the guess may lead beyond one.
MOST = {"missed": 0.5, "other": 0.9, "other_fault": 0.9, "chance": 0.5, "second_chance": 0.5}


def main() -> None:
    """Fit or evaluate."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("decks", nargs="+", type=Path, metavar="SPLIT-SEED-COMMIT.jsonl")
    ask.add_argument("--limit", type=float, default=ALONE, help="what noise leaves of the base, sigmas squared")
    ask.add_argument("--tell", action="store_true", help="fit nothing")
    names = [field.name for field in dataclasses.fields(Calibration)]
    ask.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME", help="keep all others")
    ask.add_argument("--two", type=float, metavar="SHARE", help="of pairs (default: as in the decks)")
    ask.add_argument("--write", action="store_true", help="into the package")
    args = ask.parse_args()
    every = {}
    for path in args.decks:
        seed = path.name.split("-")[1]
        every |= {(seed, case.name): (case, row) for case, row in read(int(seed), path, args.limit)}
    rows = list(every.values())
    print("present constants:", told(rows, CALIBRATION), sep="\n")
    if args.tell:
        return
    found = calibrated(rows, args.only, args.two)
    print(toml(found), "calibrated:", told(rows, found), sep="\n")
    halves = [[row for k, row in enumerate(rows) if k % 2 == half] for half in (0, 1)]
    across = [told(halves[1 - half], calibrated(halves[half], args.only, args.two)) for half in (0, 1)]
    print("calibrated on one half, told of the other:", *across, sep="\n")
    if args.write:
        path = Path(str(straw.replay.diagnose.judge.__file__)).with_name("calibration.toml")
        words = ["python -m tests.benchmarks.calibrating", *(one.name for one in args.decks)]
        words += ["--two", str(args.two)] if args.two else []
        line = "# Written by " + " ".join(words)
        if args.only != names:  # beside the command that found the others
            line = f"{path.read_text().splitlines()[0].partition(', then by')[0]}, then by {' '.join(words)} --only "
            line += " ".join(args.only)
        path.write_text(f"{line}\n{toml(found)}")
        assert Calibration(**tomllib.loads(path.read_text())["calibration"]) == found


def read(seed: int, path: Path, limit: float) -> list[tuple[Case, Mapping[str, Any]]]:
    """Cases of a deck with their findings."""
    every = {row["name"]: row for row in map(json.loads, path.read_text().splitlines())}
    split = next(iter(every)).partition("-")[0]
    cases = [case for case in deck(split, seed) if case.name in every]  # type: ignore[arg-type]
    return [
        (case, every[case.name])
        for case in cases
        if case.kind == "null" or every[case.name]["excess"]["complete"] > limit
    ]


def probability(row: Mapping[str, Any], by: Calibration) -> dict[str, float]:
    """Probabilities from the misfit that each hypothesis left."""
    own = {name: len(unknowns) for name, (unknowns, _) in causes(9).items()}
    counts = {name: sum(own[part] for part in name.split("+")) for name in row["excess"] if name != "complete"}
    return weighed(row["excess"], counts, MEASUREMENT, by)


def of_truth(case: Case, row: Mapping[str, Any], p: Mapping[str, float], by: Calibration) -> float:
    """Probability given to the truth; at least its share of `missed`, as the search may not have tried it."""
    return max(sum(v for name, v in p.items() if right(case, name, row)), by.missed / len(p))


def right(case: Case, name: str, row: Mapping[str, Any]) -> bool:
    """Whether a hypothesis names only causes that are present, and both of two where each alone leaves `ALONE` more
    than both together."""
    truth, excess = set(case.label or ("complete",)), row["excess"]
    if len(truth) == 2:
        both = next((left for other, left in excess.items() if set(other.split("+")) == truth), None)
        least = min((excess[cause] for cause in truth if cause in excess), default=0.0)
        if both is not None and least - both > ALONE:
            return set(name.split("+")) == truth
    return set(name.split("+")) <= truth


def calibrated(rows: Rows, only: Sequence[str], two: float | None = None) -> Calibration:
    """The most probable constants ``only``, under priors centred on the guess, the others as they are."""
    weights = np.ones(len(rows))
    if two is not None:
        pairs = np.array([len(case.label) == 2 for case, _ in rows])
        weights = np.where(pairs, two / np.mean(pairs), (1 - two) / np.mean(~pairs))
    start = np.zeros(len(only))
    x = minimize(lambda x: loss(rows, weights, at(x, only)) + 0.5 * np.sum(x**2), start, method="Powell", tol=1e-3).x
    return rounded(at(x, only))


def at(x: NDArray[np.float64], only: Sequence[str]) -> Calibration:
    """The present constants, with those named ``only`` at the guess, changed by x in units of OFF."""
    values = dataclasses.asdict(CALIBRATION)
    for name, step in zip(only, x, strict=True):
        guess, off = getattr(GUESS, name), getattr(OFF, name) * step
        values[name] = float(guess * np.exp(off)) if name in LOGARITHMIC else float(guess + off)
    return Calibration(**{**values, **{name: min(values[name], most) for name, most in MOST.items()}})


def loss(rows: Rows, weights: NDArray[np.float64], by: Calibration) -> float:
    """Minus the weighted log likelihood of the constants."""
    log_p = [np.log(of_truth(case, row, probability(row, by), by)) for case, row in rows]
    return -float(weights @ log_p)


def rounded(found: Calibration) -> Calibration:
    """Three significant figures each, which is their accuracy."""
    return Calibration(**{name: float(f"{value:.3g}") for name, value in dataclasses.asdict(found).items()})


def toml(found: Calibration) -> str:
    """The file as the package stores it."""
    return "[calibration]\n" + "".join(f"{name} = {value}\n" for name, value in dataclasses.asdict(found).items())


def told(rows: Rows, by: Calibration) -> str:
    """Mean logarithm of the probability of the truth, and how often the most probable hypothesis was right."""
    p = [probability(row, by) for _, row in rows]
    log = np.mean([np.log(of_truth(case, row, one, by)) for (case, row), one in zip(rows, p, strict=True)])
    top = np.array([next(iter(one.values())) for one in p])
    true = np.array([right(case, next(iter(one)), row) for (case, row), one in zip(rows, p, strict=True)])
    lines = [f"  {len(rows)} campaigns: the truth first in {true.sum()}, mean log probability of it {log:.3f}"]
    for low, high in itertools.pairwise((0.0, 0.5, 0.8, 0.95, 1.0001)):
        here = (top >= low) & (top < high)
        if here.any():
            said = f"{np.mean(top[here]):.2f} said, {np.mean(true[here]):.2f} right of {here.sum()}"
            lines.append(f"  {low:.2f} to {min(high, 1):.2f}: {said}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
