"""Where the fit of a pair starts: on the way from a fit without one of its causes, as far as that gains."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.replay.diagnose import pairs
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import cost_at, evaluated
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.pairs import find_pairs, shortened
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.system import Differences

X = np.linspace(0.0, 1.0, 200)
BASE = (Unknown("level", 1.0, kind="linear", sd=10.0),)
FIRST, RATE = Unknown("first", 1.0, sd=10.0), Unknown("second", 1.0, sd=10.0)
PAIR = Hypothesis(("first", "second"), (FIRST, RATE), ())


class Growing:
    """level + first x + exp(second x): first order around none of the second leads too far."""

    base = BASE

    def size(self, _recording: Any, _level: Any) -> int:
        return len(X)

    def misfit(self, recording: Any, unknowns: Any, u: Any, **_: Any) -> Differences:
        value = {one.target: one.value(x) for one, x in zip(unknowns, u, strict=True)}
        y = value["level"] + value.get("first", 0.0) * X + np.exp(value.get("second", 0.0) * X)
        return Differences(100 * (y - recording.y), np.zeros((len(X), len(unknowns))), np.empty((1, 0)), 1)


@pytest.mark.parametrize("alone", ["first", "second", ""])
def test_a_pair_starts_an_eighth_of_the_way_where_all_of_it_leads_too_far(alone: str) -> None:
    system: Any = Growing()
    recording: Any = SimpleNamespace(name="run", y=0.5 + 0.3 * X + np.exp(0.2 * X))
    known = (*BASE, *(one for one in (FIRST, RATE) if one.target == alone))
    unknowns = (*BASE, FIRST, RATE)
    far = Start(PAIR, np.array([0.5, 0.3, 4.0]))  # a strength of sinh(4) = 27
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([recording], system, pool)
        fit = evaluated(campaign, known, np.array([0.5, *({"first": [0.35], "second": [0.25]}.get(alone, []))]))
        start = shortened(campaign, fit, far)
        costs = [cost_at(unknowns, u, r) for u in (far.u, start.u) for r in campaign.residuals(unknowns, [u])]
    origin = {"first": [0.5, 0.35, 0.0], "second": [0.5, 0.0, 0.25], "": [0.5, 0.0, 0.0]}[alone]
    np.testing.assert_allclose(start.u - origin, (far.u - origin) / 8)
    assert costs[1] < costs[0] / 1e3


def test_a_pair_starts_at_the_end_of_the_way_where_that_is_best() -> None:
    system: Any = Growing()
    recording: Any = SimpleNamespace(name="run", y=0.5 + 0.3 * X + np.exp(0.2 * X))
    whole = Start(PAIR, np.array([0.5, np.arcsinh(0.3), np.arcsinh(0.2)]))
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([recording], system, pool)
        start = shortened(campaign, evaluated(campaign, BASE, np.array([0.7])), whole)
    np.testing.assert_allclose(start.u, whole.u)


def test_second_causes_are_sought_once_beside_each_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(pairs, "_beside", lambda _found, first, *_: asked.append(first.name))
    for name, made in (("finish", None), ("nested", None), ("reach", 0.0)):
        monkeypatch.setattr(pairs, name, lambda _found, made=made: made)
    first = SimpleNamespace(name="gas", cost=1.0, fit=object())
    found: Any = SimpleNamespace(ranked_singles=[first], best=first, beside=[])
    find_pairs(found, ["gas", "roll"])
    find_pairs(found, ["gas", "roll"])
    assert asked == ["gas"]
    first.fit = object()
    find_pairs(found, ["gas", "roll"])
    assert asked == ["gas", "gas"]
