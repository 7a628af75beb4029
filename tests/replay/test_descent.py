"""Searches of the diagnosis: valleys in which constants stand in for each other are walked to their end."""

from __future__ import annotations

import numpy as np
import pytest

from straw.replay.diagnose.contest import looks, walks
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.search import Straight, central_slopes, descend, measured_slopes

OFFSET, LENGTH = (Unknown(name, 1.0, sd=10.0, low=-8.0, high=8.0) for name in ("offset", "length"))
FIRST, SECOND = (Unknown(name, 1.0, kind="linear", sd=10.0) for name in ("first", "second"))


class Toy:
    """A campaign whose differences are a formula of the values; with a library of one cause."""

    rough = True  # all starts are looked at

    def __init__(self, formula, cause=None):
        self.formula, self.steps, self.cause, self.played = formula, {}, cause, []

    def hypothesis(self, names):
        return self.cause

    def stop(self):
        return False

    def residuals(self, unknowns, points):
        self.played += points
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


def test_where_steps_keep_what_slopes_promise_each_is_the_only_one_and_known_slopes_are_not_measured_again():
    slopes, u = np.array([[3.0, 0.0], [1.0, 2.0]]), np.zeros(2)
    played = []
    for turned, fresh, rounds in ((1, False, 1), (-1, False, 1), (1, True, 9), (1, False, 9)):
        toy = Toy(lambda v: slopes @ (np.array(v) - [1, 2]))
        given = toy.residuals((FIRST, SECOND), [u])[0]
        toy.played.clear()
        enough = 1e3 if rounds > 1 else 1.0  # more than there is to be gained
        descend(
            toy, (FIRST, SECOND), u, slopes=turned * slopes, fresh=fresh, residual=given, rounds=rounds, enough=enough
        )
        played.append(len(toy.played))
    assert played[0] == 1
    assert played[1] > 3  # uphill: another damping, the way back, and slopes
    assert played[2] == 1
    assert played[3] > 3  # slopes from elsewhere are no reason to end


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


def test_a_longer_step_that_falls_off_an_edge_does_not_spoil_a_slope():
    toy = Toy(lambda v: np.array([0.5 * v[0], v[1]] + 4 * [300.0 if v[0] > 0.1 else 0.0]))
    u = np.zeros(2)
    slopes = measured_slopes(toy, (FIRST, SECOND), u, toy.residuals((FIRST, SECOND), [u])[0], [0, 1])
    np.testing.assert_allclose(slopes, [[0.5, 0], [0, 1], *4 * [[0, 0]]], atol=1e-12)
    assert toy.steps["first"] < 0.1  # nor is it tried by the next derivative from both sides


def test_of_a_step_off_an_edge_the_slope_to_the_other_side_is_taken():
    toy = Toy(lambda v: np.array([2 * v[0], v[1]] + 4 * [300.0 if v[0] < 0 else 0.0]))
    u = np.zeros(2)
    slopes = central_slopes(toy, (FIRST, SECOND), u, toy.residuals((FIRST, SECOND), [u])[0])
    np.testing.assert_allclose(slopes, [[2, 0], [0, 1], *4 * [[0, 0]]], atol=1e-12)


def test_what_is_known_follows_a_growing_cause_where_a_leap_to_its_size_leads_away():
    cause = Hypothesis(("length",), (LENGTH,), tuple((u,) for u in (0.6, 1.0, 1.4, 1.8, 2.1, 2.4)))

    def differences(values):  # what is known makes up for the cause, but feels no more than two units of it
        first, length = values if len(values) == 2 else (*values, 0.0)
        return np.array([60 * np.tanh((first - length) / 2), 3 * (length - 5)])

    toy = Toy(differences, cause)
    known = descend(toy, (FIRST,), np.zeros(1))
    seen = looks(toy, known, ["length"])
    leap = toy.residuals((FIRST, LENGTH), [np.array([known.u[0], 2.4])])[0]
    assert leap @ leap > 3 * known.cost
    assert min(look.cost for look in seen) < known.cost / 3


def test_a_walk_goes_on_as_long_as_a_cause_only_grows():
    shape = Unknown("shape", 1.0, 1.0, "log")
    starts = ((0.5, 0.0), (1.0, 0.0), (2.0, 1.0), (-1.0, 1.0), (-2.0, 1.0), (-1.5, 1.0))
    found = walks(Hypothesis(("a cause",), (OFFSET, shape), starts), starts)
    assert [len(walk) for walk in found] == [2, 1, 2, 1]
