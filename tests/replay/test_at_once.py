"""The best single causes and pairs by fits of all causes at once, fitted by themselves."""

from __future__ import annotations

import numpy as np

from straw.replay.diagnose.at_once import foremost
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import FOLLOWED


def ranking(*names: str) -> list[Start]:
    """Starts in this order, the causes of a pair joined by +."""
    return [Start(Hypothesis(tuple(name.split("+")), (), ()), np.array([float(k)])) for k, name in enumerate(names)]


def test_the_first_hypotheses_of_either_fit_are_followed_from_both() -> None:
    one = ranking("a", "a+b", "b", "c", "b+c", "d", "e")
    other = ranking("d", "b+c", "a", "a+b", "b", "c", "e")
    singles, pairs = foremost([one, other], 1), foremost([one, other], 2)
    assert [starts[0].hypothesis.name for starts in singles] == ["a", "d", "b", "c"][:FOLLOWED]
    assert [starts[0].hypothesis.name for starts in pairs] == ["a+b", "b+c"]
    assert [[start.u[0] for start in starts] for starts in pairs] == [[1.0, 3.0], [4.0, 1.0]]


def test_without_a_fit_nothing_is_followed() -> None:
    assert foremost([], 1) == []
