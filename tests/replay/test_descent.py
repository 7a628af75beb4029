"""Searches of the diagnosis: valleys in which constants stand in for each other are walked to their end."""

from __future__ import annotations

import numpy as np
import pytest

from replay.diagnose.hypothesis import Unknown
from replay.diagnose.search import Straight, descend

OFFSET, LENGTH = (Unknown(name, 1.0, sd=10.0, low=-8.0, high=8.0) for name in ("offset", "length"))
FIRST, SECOND = (Unknown(name, 1.0, kind="linear", sd=10.0) for name in ("first", "second"))


class Toy:
    """A campaign whose differences are a formula of the values."""

    def __init__(self, formula):
        self.formula, self.steps = formula, {}

    def stop(self):
        return False

    def residuals(self, unknowns, points):
        return [self.formula([k.value(float(x)) for k, x in zip(unknowns, u, strict=True)]) for u in points]


def test_two_strengths_that_nearly_cancel_are_followed_to_their_large_values():
    toy = Toy(lambda v: np.array([300 * (v[0] - v[1] - 1), 5 * (v[1] - 9)]))
    fit = descend(toy, (OFFSET, LENGTH), np.array([np.arcsinh(1.0), 0.0]), rounds=12)
    # 2,025 at the start; what is left is the priors' price of u = 3.0 and 2.9 at a deviation of 10
    assert fit.cost < 0.2
    np.testing.assert_allclose([k.value(x) for k, x in zip(fit.unknowns, fit.u, strict=True)], [10, 9], rtol=0.01)


def test_a_valley_of_something_that_rings_is_walked_to_its_end():
    def differences(values):
        phase = 4 * values[0] + 8 * values[1]
        ringing = 20 * np.array([np.cos(phase) - np.cos(8.0), np.sin(phase) - np.sin(8.0)])
        return np.concatenate([ringing, [1.5 * (values[0] - 3)], np.zeros(4000)])

    toy = Toy(differences)
    toy.steps = {"first": 0.2, "second": 0.2}  # 0.8 and 1.6 rad: slopes from one side point elsewhere
    fit = descend(toy, (FIRST, SECOND), np.array([0.0, 1.0]), rounds=40)
    assert fit.cost < 0.2
    np.testing.assert_allclose(fit.u, [3.0, -0.5], atol=0.03)


def test_a_way_between_two_places_is_straight_in_values_and_kept_within_bounds():
    straight = Straight((OFFSET, FIRST))
    start, end = np.array([0.3, 0.3]), np.array([2.5, -1.0])
    way = straight.way(start, end)
    np.testing.assert_allclose(straight.after(start, way), end)
    middle = straight.after(start, way / 2)
    assert OFFSET.value(middle[0]) == pytest.approx((OFFSET.value(0.3) + OFFSET.value(2.5)) / 2)
    assert straight.after(start, np.array([1e9, 0.0]))[0] == OFFSET.high
    # a slope by u is the slope by value times dvalue/du
    np.testing.assert_allclose(straight.stretch(end, start), [np.cosh(2.5) / np.cosh(0.3), 1.0])
