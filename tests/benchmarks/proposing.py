"""Accuracy of the learned proposal alone on campaigns of the independent apparatus, before any fit.

    python -m tests.benchmarks.proposing --keep FOLDER            the develop split of seed 1
    python -m tests.benchmarks.proposing --split final --seed 20261129 --keep FOLDER
    python -m tests.benchmarks.proposing --recordings ../shared/recordings
    python -m tests.benchmarks.proposing --held FOLDER            what the training's folder held out, by size

A deck is opened as a whole: its labels are used here, so only development decks, or decks opened already, are suited.
``--keep`` keeps the recordings, half a minute of two cores for a deck of 67.
"""

from __future__ import annotations

import argparse
import pickle
import time
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.replay.compare.gather import gather
from straw.replay.diagnose.propose.dataset import Number, numbers
from straw.replay.diagnose.propose.learned import Learned, load, shipped
from straw.replay.diagnose.propose.network import LOG_SD
from straw.replay.diagnose.propose.proposal import Proposal, propose
from straw.replay.diagnose.propose.train import HELD_OUT, gathered
from straw.replay.diagnose.propose.train import asked as asked_of
from straw.replay.diagnose.second_causes import PAIRS
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.progress import progress_bar
from straw.rig.run import Run
from tests.apparatus.campaign import make
from tests.apparatus.cases import RUN_IDS, Case, deck, recorded
from tests.benchmarks.concealed import BASE, SIX

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

#: A score above this is confident; a cause is tried early if it is among this many.
SURE, EARLY = 0.9, 3
#: The causes concealed in the given recordings.
GIVEN = {"open-a": (), "open-b": ("cohesion",), "open-c": ("poiseuille_loss",), "open-d": ("clock_offset",)}


@dataclass(frozen=True, eq=False)
class Evaluated:
    """A proposal and the concealed causes."""

    name: str
    kind: str
    label: tuple[str, ...]
    about: str
    proposal: Proposal
    seconds: float

    @property
    def rank(self) -> int:
        """Rank (from 1) of the truth among the hypotheses; 0 for a cause that no library has."""
        names = [frozenset(one) for one, _ in self.proposal.hypotheses]
        truth = frozenset(self.label)
        return names.index(truth) + 1 if truth in names else 0

    @property
    def pair_rank(self) -> int:
        """Rank (from 1) of two concealed causes among the pairs; 0 for others."""
        pairs = [frozenset(one) for one, _ in self.proposal.hypotheses if len(one) == 2]
        truth = frozenset(self.label)
        return pairs.index(truth) + 1 if truth in pairs else 0

    @property
    def places(self) -> list[int]:
        """Ranks (from 1) of the concealed causes among the scores."""
        order = list(self.proposal.scores)
        return [order.index(cause) + 1 for cause in self.label if cause in order]


def recordings_of(case: Case, keep: Path | None, split: str, seed: int) -> tuple[Run, ...]:
    """Six runs of a case, or all it has."""
    path = keep / f"{split}-{seed}-{case.name}.pkl" if keep else None
    if path and path.exists():
        return tuple(pickle.loads(path.read_bytes())[1])
    made = make(case.truth, case.seed, SIX if case.runs == RUN_IDS else case.runs)
    runs = recorded(made, case.seed, case.name)
    if path:
        path.write_bytes(pickle.dumps((case, runs)))
    return runs


def asked(
    name: str, kind: str, label: tuple[str, ...], about: str, runs: tuple[Run, ...], learned: Learned
) -> Evaluated:
    """The proposal for some runs."""
    observations = [observe(run) for run in runs]
    start = time.process_time()
    return Evaluated(
        name, kind, label, about, propose(observations, BASE, learned=learned), time.process_time() - start
    )


def table(rows: list[Evaluated]) -> str:
    """One line per kind of case, then every case whose truth is not first, with distance and disagreement."""
    kinds: dict[str, list[Evaluated]] = defaultdict(list)
    for row in rows:
        kinds[row.kind].append(row)
    lines = [
        f"{'':12s}{'cases':>6s}{'first':>7s}{f'in {EARLY}':>7s}{'in 5':>7s}{'sure, wrong':>13s}{'unfamiliar':>12s}"
    ]
    for kind, some in sorted(kinds.items()):
        hits = Counter[str]()
        for row in some:
            hits["first"] += leads(row)
            hits["three"] += bool(row.label) and max(row.places, default=99) <= EARLY
            hits["five"] += bool(row.label) and max(row.places, default=99) <= 5
            hits["sure"] += surely_wrong(row)
            hits["strange"] += not row.proposal.familiar
        counts = "".join(f"{hits[k]:7d}" for k in ("first", "three", "five"))
        lines.append(f"{kind:12s}{len(some):6d}{counts}{hits['sure']:13d}{hits['strange']:12d}")
    two = [row for row in rows if len(row.label) == 2]
    early = sum(0 < row.pair_rank <= PAIRS for row in two)
    lines += [f"pairs among the first {PAIRS} pairs: {early} of {len(two)}"] if two else []
    slowest = max(row.seconds for row in rows)
    lines += [f"slowest: {slowest:.2f} s of one core", "", "truth not in front:"]
    for row in rows:
        if not leads(row):
            best = ", ".join(f"{n} {s:.2f}" for n, s in list(row.proposal.scores.items())[:3])
            guard = f"distance {row.proposal.distance:.3f}, disagreement {row.proposal.disagreement:.2f}"
            lines.append(f"  {row.name:14s}{row.kind:11s}{row.about:58s} place {row.places}; {best}; {guard}")
    return "\n".join(lines)


def leads(row: Evaluated) -> bool:
    """Whether the true causes have the highest scores; no score above one half where there are none."""
    if not row.places:
        return max(row.proposal.scores.values()) < 0.5
    return max(row.places) <= len(row.places)


def surely_wrong(row: Evaluated) -> bool:
    """Whether a cause that is absent has a confident score."""
    return any(score > SURE and name not in row.label for name, score in row.proposal.scores.items())


def held_out(folder: Path, learned: Learned) -> str:
    """Held-out simulations by size of the effect, and the distance of starting values from the truth."""
    examples = gathered(folder, 1, (HELD_OUT,))
    names, straw = learned.about["causes"], BASE
    said = asked_of(list(learned.members), learned.scaling, examples).astype(np.float64)
    scores = (1 / (1 + np.exp(-said[..., : len(names)] / learned.about["temperature"]))).mean(axis=0)
    wanted, n = numbers(straw), len(learned.about["numbers"])
    means = said[..., len(names) : len(names) + n].mean(axis=0)
    spread = np.exp(np.clip(said[..., len(names) + n :], *LOG_SD)).mean(axis=0)
    scales = np.array(learned.about["scales"])
    off = means * scales - examples.values
    units = _largest_units(examples.values, wanted, names)
    many = examples.present.sum(axis=1)
    places = np.argsort(np.argsort(-scores, axis=1), axis=1)
    heads = (("units", 13), ("one", 6), ("first", 7), ("in 3", 7), ("two", 6), ("first", 7), ("in 4", 7))
    lines = [f"{len(examples)} held-out simulations, runs of any protocol, asked once"]
    lines.append("".join(f"{head:>{width}s}" for head, width in heads))
    for low, high in ((0.0, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, np.inf)):
        cells = f"{low:5.0f} to {high:4.0f}"
        for count, early in ((1, 3), (2, 4)):
            least = np.min(np.where(examples.present, units, np.inf), axis=1)
            some = (many == count) & (least >= low) & (least < high)
            worst = np.max(np.where(examples.present, places, -1), axis=1)[some]
            cells += f"{some.sum():6d}{np.mean(worst < count):7.2f}{np.mean(worst < early):7.2f}"
        lines.append(cells)
    nothing = scores[many == 0].max(axis=1)
    lines.append(f"nothing there: {len(nothing)}, no score above one half in {np.mean(nothing < 0.5):.2f}")
    for k, number in enumerate(wanted):
        there = np.isfinite(off[:, k])
        if (not number.cause or number.unknown.kind == "strength") and there.sum() > 5:
            e, s = off[there, k], spread[there, k] * scales[k]
            rms, scatter = np.sqrt(np.mean(e**2)), np.std(examples.values[there, k])
            lines.append(f"  {number.name:58s} off by {rms:5.2f} u, stated {s.mean():5.2f}, of {scatter:5.2f}")
    return "\n".join(lines)


def _largest_units(values: Singles, wanted: list[Number], names: list[str]) -> Floats:
    """Size of each cause that is present, in the library's units (recordings, causes)."""
    out = np.zeros((len(values), len(names)))
    for k, number in enumerate(wanted):
        if number.cause in names and number.unknown.kind == "strength" and not number.size_only:
            size = np.sinh(np.abs(np.nan_to_num(values[:, k].astype(np.float64))))
            column = names.index(number.cause)
            out[:, column] = np.maximum(out[:, column], size)
    return out


def main() -> None:
    """Evaluate and print."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--split", choices=("develop", "final", "strong", "two"), default="develop")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--cases", type=int, default=10**6)
    ask.add_argument("--keep", type=Path, help="folder for the recordings")
    ask.add_argument("--recordings", type=Path, help="folder with open-a to open-d")
    ask.add_argument("--held", type=Path, help="folder of a training")
    ask.add_argument("--weights", type=Path, help="instead of those that come with the package")
    args = ask.parse_args()
    learned = load(args.weights) if args.weights else shipped()
    print(f"learned from {learned.about['recordings']} recordings; held out: {learned.about['held_out']}")
    rows = []
    if args.held:
        print(held_out(args.held, learned))
        return
    if args.recordings:
        for name, label in GIVEN.items():
            runs = tuple(gather(sorted((args.recordings / name).glob("*.mcap"))))
            rows.append(asked(name, "given", label, " + ".join(label), runs, learned))
    else:
        cases = deck(args.split, args.seed)[: args.cases]
        with progress_bar("cases", "cases") as update:
            for k, case in enumerate(cases):
                about = " + ".join(f"{c.name} {c.size:.3g} {c.form}" for c in case.truth)
                runs = recordings_of(case, args.keep, args.split, args.seed)
                rows.append(asked(case.name, case.kind, case.label, about, runs, learned))
                update(k + 1, len(cases))
    print(table(rows))


if __name__ == "__main__":
    main()
