"""Decks of sealed cases: what is concealed in each, drawn by seed, and the hash published before the analysis."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from straw.rig.run import Run

from .campaign import Made, effect_sigma, make, record, repeat_sigma
from .effects import INSTRUMENT, PHYSICS, REST, RESTS, UNKNOWN, Cause, Range
from .plans import RUN_IDS

#: ``strong`` has single causes in the upper third of their ranges and beyond; ``rest`` a large cause, or one outside
#: the library, beside a small smooth residual that no cause explains; ``two`` sixty pairs of any two causes;
#: ``outside`` sixty causes that no library has.
Split = Literal["develop", "final", "strong", "rest", "two", "outside"]
STEPS = tuple(run for run in RUN_IDS if run.startswith(("deploy", "fold")))
ONE_STEP = tuple(run for run in RUN_IDS if run.startswith("deploy-35"))
QUIET = ("staircase", "pulses", "fold-20kPa-2-5")
# Pairs that the given runs hardly distinguish: the truth may be either of them.
HARD = (
    (("clock_offset", "line_lag"), STEPS),
    (("cohesion", "squeeze_film"), ONE_STEP),
    (("viscoelasticity", "dry_friction"), ONE_STEP),
    (("fluid_inertia", "poiseuille_loss"), ONE_STEP),
    (("crease_stiffness", "intrinsic_curvature"), QUIET),
    (("camera_roll", "intrinsic_curvature"), QUIET),
)
HIDDEN_TOGETHER = (
    ("cohesion", "clock_offset"), ("squeeze_film", "gauge_offset"), ("poiseuille_loss", "tip_offset"),
    ("frustum_spread", "camera_roll"), ("viscoelasticity", "length_scale"), ("fluid_inertia", "gauge_gain"),
    ("dry_friction", "clock_drift"), ("trapped_gas", "camera_roll"), ("squeeze_film", "cohesion"),
    ("frustum_spread", "poiseuille_loss"), ("asymmetry", "line_lag"), ("crease_stiffness", "fluid_inertia"),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One campaign to be diagnosed. ``pair`` names the causes that its runs may leave undecided."""

    name: str
    kind: Literal["null", "single", "unknown", "hard_pair", "two", "instrument"]
    truth: tuple[Cause, ...]
    seed: int
    runs: tuple[str, ...] = RUN_IDS
    pair: tuple[str, ...] = ()

    @property
    def label(self) -> tuple[str, ...]:
        """Names of the contract, sorted: () for complete, ("unknown",) for a cause that no library has."""
        return tuple(sorted(cause.name for cause in self.truth if cause.name != REST))


@dataclass(frozen=True)
class Generated:
    """A case's recordings, and per run the effect of its causes, and of the scatter of repeats alone, in sigmas."""

    case: Case
    runs: tuple[Run, ...]
    effect_sigma: dict[str, float]
    repeat_sigma: dict[str, float]


def recorded(made: list[Made], seed: int, name: str) -> tuple[Run, ...]:
    """The runs as the instruments record them."""
    return tuple(record(one, seed, name) for one in made)


def generate(case: Case, seen: Callable[[list[Made], int, str], tuple[Run, ...]] = recorded) -> Generated:
    """Make the recordings of a case; the same case gives the same bytes."""
    made = make(case.truth, case.seed, case.runs)
    runs = seen(made, case.seed, case.name)
    effect = effect_sigma(made, make((), case.seed, case.runs) if case.truth else made)
    floor = repeat_sigma(case.seed)
    return Generated(case, runs, effect, {run: floor[run] for run in case.runs})


def _sized(name: str, sizes: Range, low: float, high: float, rng: np.random.Generator, form: str = "") -> Cause:
    """A cause whose size lies between two shares (of 0 to 1, logarithmic) of its range."""
    size = float(sizes.weak * (sizes.strong / sizes.weak) ** rng.uniform(low, high))
    return Cause(name, size, form or str(rng.choice(list(sizes.forms))), int(rng.integers(2**31)))


def deck(split: Split, seed: int) -> list[Case]:
    """The cases of a split in random order, under neutral names: 134 "final", 67 to "develop" with."""
    if split in ("strong", "rest"):
        return _of_one_kind(split, seed)
    if split in ("two", "outside"):
        return _sixty(split, seed)
    rng = np.random.default_rng([seed, 0 if split == "develop" else 1])
    final = split == "final"
    cases: list[Case] = []

    def add(kind: str, *truth: Cause, runs: tuple[str, ...] = RUN_IDS, pair: tuple[str, ...] = ()) -> None:
        cases.append(Case("", kind, truth, int(rng.integers(2**31)), runs, pair))

    for _ in range(20 if final else 12):
        add("null")
    for kind, causes, levels in (("single", PHYSICS, 4 if final else 2), ("instrument", INSTRUMENT, 3 if final else 1)):
        for name, sizes in causes.items():
            for level in range(levels):
                add(kind, _sized(name, sizes, level / levels, (level + 1) / levels, rng))
    names = list(UNKNOWN) if final else list(rng.permutation(list(UNKNOWN)))[:8]
    for form in names:
        add("unknown", _sized("unknown", UNKNOWN[form], 0.3, 1.0, rng, str(form)))
    for (first, second), runs in HARD[: 5 if final else 6]:
        for name in (first, second) if final else (str(rng.choice([first, second])),):
            add("hard_pair", _sized(name, (PHYSICS | INSTRUMENT)[name], 0.5, 0.8, rng), runs=runs, pair=(first, second))
    together = HIDDEN_TOGETHER if final else HIDDEN_TOGETHER[::2]
    for pair in together:
        add("two", *(_sized(name, (PHYSICS | INSTRUMENT)[name], 0.5, 0.9, rng) for name in pair))
    order = rng.permutation(len(cases))
    return [replace(cases[k], name=f"{split}-{i:03d}") for i, k in enumerate(order)]


def _of_one_kind(split: Split, seed: int) -> list[Case]:
    """Two cases of every cause; with a ``rest``, also one of every form outside the library."""
    rng = np.random.default_rng([seed, 2 if split == "strong" else 3])
    known = [(name, sizes, "") for _ in range(2) for name, sizes in {**PHYSICS, **INSTRUMENT}.items()]
    outside = [("unknown", sizes, form) for form, sizes in UNKNOWN.items()] if split == "rest" else []
    cases = []
    for name, sizes, form in (*known, *outside):
        kind = "unknown" if form else "instrument" if name in INSTRUMENT else "single"
        low, high = (0.67, 1.2) if split == "strong" else (0.5, 1.0)
        truth = [_sized(name, sizes, low, high, rng, form)]
        if split == "rest":
            truth.append(_sized(REST, RESTS, 0.0, 1.0, rng))
        cases.append(Case("", kind, tuple(truth), int(rng.integers(2**31))))
    order = rng.permutation(len(cases))
    return [replace(cases[k], name=f"{split}-{i:03d}") for i, k in enumerate(order)]


def _sixty(split: Split, seed: int) -> list[Case]:
    """Pairs of any two causes from the middle of their ranges up, or every form outside the library in turn."""
    rng, known = np.random.default_rng([seed, 4 if split == "two" else 5]), {**PHYSICS, **INSTRUMENT}
    cases, forms = [], list(UNKNOWN)
    for k in range(60):
        if split == "two":
            names = [str(name) for name in rng.choice(list(known), size=2, replace=False)]
            truth = tuple(_sized(name, known[name], 0.5, 1.0, rng) for name in names)
        else:
            form = forms[k % len(forms)]
            truth = (_sized("unknown", UNKNOWN[form], 0.3, 1.0, rng, form),)
        cases.append(Case("", "two" if split == "two" else "unknown", truth, int(rng.integers(2**31))))
    order = rng.permutation(len(cases))
    return [replace(cases[k], name=f"{split}-{i:03d}") for i, k in enumerate(order)]


def labels(cases: list[Case]) -> list[dict[str, object]]:
    """Everything that is concealed, as plain data."""
    return [asdict(case) for case in cases]


def seal(cases: list[Case]) -> str:
    """SHA-256 of the labels as canonical JSON, published before the analysis, so that they cannot be changed."""
    text = json.dumps(labels(cases), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def opened(cases: list[Case], sealed: str) -> list[dict[str, object]]:
    """The labels, checked against the seal; ValueError where they do not match it."""
    if seal(cases) != sealed:
        raise ValueError("the labels are not those that were sealed")
    return labels(cases)
