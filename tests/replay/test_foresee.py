"""Forecasts of a diagnosis: an experiment's information by the judge's weights, and the number of identical runs."""

from __future__ import annotations

import numpy as np
import pytest

from straw.replay.diagnose.judge import Judgement, weighed
from straw.replay.investigate.foresee import MOST_ALIKE, Foreseen, foreseen, takes_part

TWO = {"cohesion": 1, "squeeze_film": 1}


def seen(apart: float, excess: dict[str, float] | None = None, left_over: float = 0.0) -> Foreseen:
    """Two causes whose predictions are this many sigmas apart, each of which explains what the base does not."""
    excess = excess or {"complete": 3000.0, "cohesion": 0.0, "squeeze_film": 0.0}
    judgement = Judgement(weighed(excess, TWO, ()), excess, left_over)
    return foreseen(judgement, TWO, list(TWO), np.array([[0.0, apart], [apart, 0.0]]), 0.9)


def test_hypotheses_without_separation_are_not_distinguished_by_any_number_of_runs() -> None:
    none = seen(0.0)
    assert none.information_nats == 0
    assert none.chances == (0.0,) * MOST_ALIKE


def test_a_large_separation_decides_in_one_run_and_a_smaller_one_in_several() -> None:
    assert seen(100.0).chances[0] == pytest.approx(1.0)
    runs = [next((n for n, c in enumerate(seen(s).chances, 1) if c > 0.9), 99) for s in (7.0, 10.0, 20.0)]
    assert runs == sorted(runs, reverse=True)
    assert runs[0] > runs[-1] == 1


def test_information_grows_with_the_separation_and_stays_below_the_entropy() -> None:
    told = [seen(s).information_nats for s in (2.0, 5.0, 10.0, 40.0)]
    assert told == sorted(told)
    assert 0 < told[0] < told[-1] < np.log(2) + 0.1  # and what "unknown" loses


def test_the_posterior_after_runs_that_turn_out_as_expected_is_the_forecast() -> None:
    """n runs that turn out as one cause predicts add n s^2 to the misfit of the other: the judge is then as certain."""
    apart, excess = 9.0, {"complete": 3000.0, "cohesion": 0.0, "squeeze_film": 0.0}
    for runs, chance in enumerate(seen(apart).chances, 1):
        after = weighed({**excess, "squeeze_film": runs * apart**2}, TWO, ())
        assert (after["cohesion"] >= 0.9) == (chance > 0.4)


def test_a_cause_with_a_large_misfit_of_its_own_is_not_expected_to_be_named() -> None:
    """That probability goes to "unknown"."""
    excess = {"complete": 40_000.0, "cohesion": 9000.0, "squeeze_film": 9500.0}
    assert seen(100.0, excess, 9000.0).chances == (0.0,) * MOST_ALIKE


def test_hypotheses_under_which_the_run_cannot_be_simulated_keep_their_misfit() -> None:
    assert seen(float("nan")) == seen(0.0)


def test_a_cause_counts_alone_and_in_a_pair() -> None:
    probability = {"a": 0.5, "a+b": 0.3, "b": 0.1, "unknown": 0.1}
    assert takes_part(probability, ["a"]) == pytest.approx(0.8)
    assert takes_part(probability, ["a", "b"]) == pytest.approx(0.4)


def test_hypotheses_that_are_each_improbable_count_until_the_runs_can_tell_them_apart() -> None:
    """Eight rivals that no experiment was simulated for: together they keep the first below the required certainty."""
    small = {f"rival_{k}": 1 for k in range(8)}
    excess = {"complete": 3000.0, "cohesion": 0.0, "squeeze_film": 150.0, **dict.fromkeys(small, 60.0)}
    judgement = Judgement(weighed(excess, TWO | small, ()), excess, 0.0)
    assert 1 - judgement.probability["cohesion"] > sum(judgement.probability[name] for name in small) > 0.1

    def chances(apart: float, constants: dict[str, int]) -> tuple[float, ...]:
        return foreseen(judgement, constants, list(TWO), np.array([[0.0, apart], [apart, 0.0]]), 0.9).chances

    assert max(chances(3.0, TWO)) > 0.9  # as without the eight
    together = chances(3.0, TWO | small)
    assert together[0] == 0.0
    assert max(chances(100.0, TWO | small)) > 0.9
