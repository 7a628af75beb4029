"""Large effects: what the proposal puts first is tried first, and what cannot catch up with it is left out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.replay.diagnose import coarse_search
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.propose.proposal import Proposal, Start
from straw.replay.diagnose.system import Differences, Level, System

SAMPLES = 960
NAMES = ("base", "first", "second", "third")
COLUMNS = dict(zip(NAMES, np.random.default_rng(8).normal(size=(len(NAMES), SAMPLES)), strict=True))
NOISE = np.random.default_rng(9).normal(size=SAMPLES)


class Linear(System):
    """A sum of columns, each times its strength, and a proposal; compared coarsely, differences count a third."""

    channels = ()
    base = (Unknown("base", 1.0, kind="linear", sd=100.0),)
    causes = NAMES[1:]

    def __init__(self, scores: dict[str, float], strengths: dict[str, float], pairs: Sequence[tuple[str, str]]) -> None:
        self.scores, self.strengths, self.pairs = scores, strengths, pairs

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        return Hypothesis(tuple(names), tuple(Unknown(name, 1.0, sd=10.0) for name in names), ((1.0,),))

    def propose(self, recordings: Sequence[Any], names: Sequence[str]) -> Proposal:
        starts = {
            name: (Start(*self.hypothesis([name]).unknowns, np.arcsinh(k), 1.0),) for name, k in self.strengths.items()
        }
        base = (Start(self.base[0], 0.0, 1.0),)
        hypotheses = tuple((pair, 0.1) for pair in self.pairs)
        return Proposal(self.scores, hypotheses, base, starts, 0.0, 0.0, (), ())

    def misfit(
        self,
        recording: Any,
        unknowns: Sequence[Unknown],
        u: np.ndarray,
        *,
        level: Level = Level.FINE,
        derivatives: bool = False,
    ) -> Differences:
        A = np.stack([COLUMNS[one.target] for one in unknowns], axis=1)
        values = np.array([one.value(x) for one, x in zip(unknowns, u, strict=True)])
        slopes = A * [one.per_u(x) for one, x in zip(unknowns, u, strict=True)]
        share = 1 / 3 if level is Level.COARSE else 1.0
        return Differences(share * (A @ values - recording.seen[0]), share * slopes, np.empty((1, 0)), 1)

    def size(self, recording: Any, level: Level) -> int:
        return SAMPLES


def search(system: Linear, y: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> tuple[Inquiry, list[list[str]]]:
    """The search, and the causes of each tournament among own starts."""
    asked: list[list[str]] = []
    real = coarse_search.tournament

    def watched(wide: Any, known: Any, hypotheses: Sequence[Hypothesis], begun: Any) -> Any:
        asked.append([h.name for h in hypotheses])
        return real(wide, known, hypotheses, begun)

    monkeypatch.setattr(coarse_search, "tournament", watched)
    run: Any = SimpleNamespace(name="run", seen=y[None, :], events_s=(), kind=0)
    with ThreadPoolExecutor(1) as pool:
        return inquire([run], system, executor=pool), asked


def test_a_pair_that_the_proposal_puts_first_explains_the_runs_before_own_starts_are_tried(monkeypatch) -> None:
    scores = {"first": 0.9, "third": 0.3, "second": 0.2}
    system = Linear(scores, {"first": 8.0, "second": 5.0, "third": 1.0}, [("first", "second")])
    found, asked = search(system, 9 * COLUMNS["first"] + 6 * COLUMNS["second"] + NOISE, monkeypatch)
    assert found.contestants[0].hypothesis.causes == ("first", "second")
    assert not found.goes_on
    assert asked == []


def test_causes_far_behind_one_that_explains_the_runs_are_not_fitted_from_their_own_starts(monkeypatch) -> None:
    scores = {"first": 0.9, "third": 0.3, "second": 0.2}
    system = Linear(scores, {"first": 8.0, "second": 5.0, "third": 1.0}, [("first", "second")])
    found, asked = search(system, 9 * COLUMNS["first"] + NOISE, monkeypatch)
    assert found.contestants[0].name == "first"
    assert asked == [["first"]]


def test_where_the_proposal_is_wrong_every_cause_is_fitted_from_its_own_starts(monkeypatch) -> None:
    scores = {"second": 0.9, "third": 0.3, "first": 0.2}
    system = Linear(scores, {"first": -100.0, "second": 5.0, "third": 1.0}, [("second", "third")])
    found, asked = search(system, 9 * COLUMNS["first"] + NOISE, monkeypatch)
    assert found.contestants[0].name == "first"
    assert not found.goes_on
    assert asked[0] == ["first", "second", "third"]
