"""Ways to choose the next run on a straw that conceals something; each is the loop of `straw investigate` itself."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from straw.replay.cli import parser
from straw.replay.diagnose.systems.straw.menu import allowed, drawn, menu, written
from straw.replay.investigate.bench import Bench, check_place
from straw.replay.investigate.budget import Budget
from straw.replay.investigate.campaign import Folder
from straw.replay.investigate.log import Log, log_of
from straw.replay.investigate.loop import Loop
from straw.replay.investigate.propose import DRAWN
from straw.replay.investigate.steps import Found, Proposal
from straw.rig.limits import STRAW_LIMITS
from straw.rig.protocol_toml import protocol_from_toml
from tests.apparatus.cases import Case
from tests.apparatus.plans import PLANS
from tests.apparatus.rig import ApparatusRig, as_toml
from tests.benchmarks.concealed import BASE

SPECIMEN = "apparatus"
#: Number of random protocols tried in a round until the model can simulate one.
OFFERED = 6


class Chosen(Bench):
    """Runs chosen by the loop itself. The search for a law outside the library is left out: it takes minutes, and
    comes after the reason to stop is known."""

    def unknown(self, found: Found) -> str:
        return ""


class Given(Chosen):
    """Runs chosen otherwise, so that a complete model is an answer without further runs."""

    def untried(self) -> list[Proposal]:
        return []


class InTurn(Given):
    """The fixed campaign's runs in their order, diagnosed after each."""

    def propose(self, found: Found) -> Sequence[Proposal]:
        return [as_it_is(as_toml(plan)) for plan in PLANS[len(self._known) :][:1]]


class Fixed(InTurn):
    """The whole fixed campaign, then one diagnosis, as without a loop."""

    def diagnose(self) -> Found:
        runs = len(self.folder.paths()) // 2  # a run and its track
        if runs < len(PLANS):
            self._known = [""] * runs
            return Found("too_few", says=f"{runs} runs so far", recordings=self.folder.sums())
        return super().diagnose()


class Random(Given):
    """Random protocols of those that the loop considers, after its own first runs; diagnosed after each run."""

    seed = 0

    def propose(self, found: Found) -> Sequence[Proposal]:
        if found.verdict == "too_few":
            return super().propose(found)
        rng = np.random.default_rng([self.seed, len(self._known)])
        cells = self.straw.cells
        choices = [c for c in menu(cells) if allowed(c, self.limits)]
        choices += [drawn(rng, cells, self.limits) for _ in range(DRAWN)]
        at = rng.permutation(len(choices))[:OFFERED]
        return [as_it_is(written(choices[i], self.limits)) for i in at]


WAYS: dict[str, type[Chosen]] = {"loop": Chosen, "in_turn": InTurn, "random": Random, "fixed": Fixed}


def as_it_is(protocol: str) -> Proposal:
    """A run that is made whatever its expected information."""
    read = protocol_from_toml(protocol, "a plan")
    return Proposal(protocol, read.initial_deployed, read.name, 0.0, 0.0, read.duration_s / 60, 0, opening=True)


def investigated(case: Case, way: str, certainty: float, rounds: int, place: Path) -> dict[str, Any]:
    """How a loop on the apparatus ended, without access to the case's label; it continues from the log in ``place``."""
    started, path = time.process_time(), place / f"{case.name}-{way}"
    path.mkdir(parents=True, exist_ok=True)
    folder, log_path = Folder(path, SPECIMEN), log_of(path, SPECIMEN)
    rounds_place = log_path.with_suffix("")
    check_place(rounds_place)
    args = parser().parse_args(["investigate", str(path), "--emulate", "--fast", "--operator", "benchmark"])
    with Log(log_path) as log, ThreadPoolExecutor(1) as pool:
        bench = WAYS[way](
            args,
            BASE,
            STRAW_LIMITS,
            None,
            folder,
            rounds_place,
            pool,
            ApparatusRig(case.truth, case.seed),
            lambda *_: "benchmark",
        )
        if isinstance(bench, Random):
            bench.seed = case.seed
        loop = Loop(log, bench, Budget(rounds), certainty, rounds)
        stop = loop.run()
        found = [line for line in log.lines if line["kind"] == "diagnosed" and line["probability"]]
        ran = [line["proposal"]["protocol"] for line in log.lines if line["kind"] == "proposed"]
    return {
        "name": case.name,
        "way": way,
        "reason": stop.reason,
        "says": stop.says,
        "verdict": found[-1]["verdict"] if found else "",
        "causes": found[-1]["causes"] if found else [],
        **asdict(loop.state.spent),
        "ran": [protocol_from_toml(text, "a run").name for text in ran],
        "diagnoses": [_diagnosis(line) for line in found],
        "cpu_s": time.process_time() - started,
    }


def _diagnosis(line: dict[str, Any]) -> dict[str, Any]:
    most = dict(sorted(line["probability"].items(), key=lambda item: -item[1])[:5])
    probability = {name: round(p, 4) for name, p in most.items()}
    return {"round": line["round"], "verdict": line["verdict"], "causes": line["causes"], "probability": probability}
