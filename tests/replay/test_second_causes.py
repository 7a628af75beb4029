"""Two causes at once: a pair is found in the coarse comparison beside the causes that lead it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, evaluated
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.second_causes import SHOWS, beside_any, second_causes
from straw.replay.diagnose.settings import EXPLAINED
from straw.replay.diagnose.system import Differences, System
from straw.replay.diagnose.tournament import contenders, tournament

RNG = np.random.default_rng(3)
SAMPLES = 400
LEVEL, FIRST, SECOND, OTHER, EXTRA = RNG.normal(size=(5, SAMPLES))
#: The decoy is the single column nearest to the sum of the first and the second.
COLUMNS = {"base": LEVEL, "first": FIRST, "second": SECOND, "other": OTHER, "decoy": FIRST + SECOND + 0.8 * EXTRA}
#: Sigmas of noise: the coarse comparison's own leave room, so that what explains it leaves a fraction.
NOISE = 0.2


class Linear(System):
    """A sum of columns, each times its strength, against data with noise of less than one sigma."""

    channels = ()
    base = (Unknown("base", 1.0, kind="linear", sd=10.0),)
    causes = ("first", "second", "other", "decoy")

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        (name,) = names
        return Hypothesis((name,), (Unknown(name, 1.0, sd=10.0),), ((0.3,), (3.0,)))

    def misfit(self, recording, unknowns, u, *, level=None, derivatives=False):
        A = np.stack([COLUMNS[one.target] for one in unknowns], axis=1)
        values = np.array([one.value(x) for one, x in zip(unknowns, u, strict=True)])
        slopes = A * [one.per_u(x) for one, x in zip(unknowns, u, strict=True)]
        return Differences(A @ values - recording.y, slopes, np.empty((1, 0)), 1)

    def size(self, recording, level):
        return SAMPLES


def searched(y: np.ndarray, system: Linear | None = None) -> tuple[list[Contestant], list[Contestant]]:
    """Single causes and pairs, the best first."""
    system = system or Linear()
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([SimpleNamespace(name="run", y=y)], system, pool)
        known = evaluated(campaign, system.base, np.zeros(1))
        every = [system.hypothesis([name]) for name in system.causes]
        singles = tournament(campaign, known, every)
        return singles, second_causes(campaign, known, contenders(singles[:2]), every, None)


def noise() -> np.ndarray:
    return NOISE * RNG.normal(size=SAMPLES)


def test_two_causes_come_first_although_a_third_is_the_best_single_one():
    singles, pairs = searched(2 * LEVEL + 2 * FIRST + 2 * SECOND + noise())
    assert singles[0].name == "decoy"
    (pair,) = pairs  # what leaves twice as much is not continued
    assert pair.hypothesis.causes == ("first", "second")
    assert pair.cost < EXPLAINED * SAMPLES < singles[0].cost


def test_beside_a_cause_that_explains_the_comparison_no_second_is_fitted_unless_it_promises_to_show():
    alone = 2 * LEVEL + 3 * FIRST + noise()
    singles, pairs = searched(alone)
    assert [one.name for one in singles] == ["first"]
    assert pairs == []
    much = np.sqrt(2 * SHOWS / SAMPLES)  # gains about twice the limit
    singles, pairs = searched(alone + much * SECOND)
    assert singles[0].cost < EXPLAINED * SAMPLES
    assert pairs[0].hypothesis.causes == ("first", "second")
    assert singles[0].cost - pairs[0].cost == pytest.approx(2 * SHOWS, rel=0.5)


def test_a_second_cause_starts_from_the_shape_that_gains_most():
    class Switched(Linear):
        """With a cause whose column is the second or the extra one, by the sign of a constant."""

        causes = ("first", "switched")

        def hypothesis(self, names: Sequence[str]) -> Hypothesis:
            if names != ["switched"]:
                return super().hypothesis(names)
            sign = Unknown("sign", 1.0, kind="linear", sd=10.0)
            return Hypothesis(("switched",), (Unknown("switched", 1.0, sd=10.0), sign), ((1.0, 1.0), (1.0, -1.0)))

        def misfit(self, recording, unknowns, u, *, level=None, derivatives=False):
            at = dict(zip((one.target for one in unknowns), u, strict=True))
            column = EXTRA if at.pop("sign", 1.0) > 0 else SECOND
            strength = at.pop("switched", 0.0)
            kept = tuple(one for one in unknowns if one.target in at)
            plain = super().misfit(recording, kept, np.array([*at.values()]), derivatives=derivatives)
            slopes = dict(zip(at, plain.jacobian.T, strict=True))
            slopes |= {"switched": np.cosh(strength) * column, "sign": np.zeros(SAMPLES)}
            every = np.stack([slopes[one.target] for one in unknowns], axis=1)
            return Differences(plain.vector + np.sinh(strength) * column, every, np.empty((1, 0)), 1)

    y = 2 * LEVEL + 9 * FIRST + 2 * EXTRA + noise()
    singles, pairs = searched(y, Switched())
    assert singles[0].name == "first"
    assert pairs[0].hypothesis.causes == ("first", "switched")
    assert pairs[0].cost < EXPLAINED * SAMPLES


def contestant(name: str, cost: float) -> Contestant:
    fit = SimpleNamespace(cost=cost, residual=np.zeros(SAMPLES))
    return Contestant(Hypothesis(tuple(name.split("+")), (), ()), fit)  # type: ignore[arg-type]


def test_a_pair_is_refined_at_once_where_it_explains_the_comparison_and_no_single_cause_does_as_well():
    explains, fails = 0.5 * EXPLAINED * SAMPLES, 2 * EXPLAINED * SAMPLES
    pair = contestant("a+b", explains)
    assert beside_any([pair], [contestant("a", fails)])
    assert not beside_any([pair], [contestant("a", explains + 0.5 * CALIBRATION.scale)])
    assert not beside_any([contestant("a+b", fails)], [contestant("a", 2 * fails)])
    assert not beside_any([], [contestant("a", fails)])
