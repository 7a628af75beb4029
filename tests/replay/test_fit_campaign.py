"""Robust least squares on exact Jacobians: minima are found, bounds and priors kept, a stop gives the best so far."""

from __future__ import annotations

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Point
from straw.replay.diagnose.fit import cost_at, fits_from, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import curvature, robust_cost
from straw.replay.diagnose.settings import ROBUST_SIGMAS

OFFSET, LENGTH = (Unknown(name, 1.0, sd=10.0, low=-8.0, high=8.0) for name in ("offset", "length"))
FIRST, SECOND = (Unknown(name, 1.0, kind="linear", sd=10.0) for name in ("first", "second"))


class Toy:
    """A campaign whose residuals are a formula of the values; the Jacobian by complex steps."""

    def __init__(self, formula, stops_after=None):
        self.formula, self.stops_after, self.asked, self.differentiated = formula, stops_after, 0, 0

    def stop(self):
        return self.stops_after is not None and self.asked >= self.stops_after

    def _of(self, unknowns, u):
        values = [np.sinh(x) if k.kind == "strength" else x for k, x in zip(unknowns, u, strict=True)]
        return np.asarray(self.formula([k.scale * v for k, v in zip(unknowns, values, strict=True)]))

    def at(self, points):
        self.asked += len(points)
        self.differentiated += sum(point.derivatives for point in points)
        return [(self._of(p.unknowns, p.u).real, self._by_u(p) if p.derivatives else np.empty((0, 0))) for p in points]

    def residuals(self, unknowns, points):
        return [residual for residual, _ in self.at([Point(unknowns, u) for u in points])]

    def _by_u(self, point):
        steps = 1e-30j * np.eye(len(point.u))
        return np.stack([self._of(point.unknowns, point.u + step).imag / 1e-30 for step in steps], axis=1)


def test_two_nearly_cancelling_strengths_are_followed_to_their_large_values():
    toy = Toy(lambda v: np.array([300 * (v[0] - v[1] - 1), 5 * (v[1] - 9)]))
    fit = fitted(toy, (OFFSET, LENGTH), np.array([np.arcsinh(1.0), 0.0]), rounds=30)
    # 2,025 at the start; what is left is the priors' cost of u = 3.0 and 2.9 at a deviation of 10
    assert fit.cost < 0.2
    np.testing.assert_allclose([k.value(x) for k, x in zip(fit.unknowns, fit.u, strict=True)], [10, 9], rtol=0.01)


def test_a_strength_that_a_constant_compensates_is_followed_along_their_straight_valley():
    toy = Toy(lambda v: np.array([300 * (v[0] - v[1]), 0.5 * (v[0] - 30)]))
    fit = fitted(toy, (OFFSET, FIRST), np.array([np.arcsinh(0.5), 0.5]), rounds=100)
    # the valley is linear in the values, so steps double in length from 1: 1 + 2 + 4 + 8 + 16 > 30
    assert toy.asked <= 2 * 8
    assert OFFSET.value(fit.u[0]) == pytest.approx(30, rel=0.1)


@pytest.mark.parametrize("sigmas", [0.1, 3.0, 40.0, 1e4])
def test_the_curvature_of_the_loss_is_that_of_the_square_of_its_root(sigmas):
    h = 1e-5 * sigmas
    high, low = (np.sqrt(robust_cost(np.array([sigmas + d]))) for d in (h, -h))
    assert curvature(np.array([sigmas]))[0] == pytest.approx(((high - low) / (2 * h)) ** 2, rel=1e-6)


def test_an_outlier_counts_linearly_and_not_squared():
    data = np.array([0.1, -0.1, 0.0, 40.0])
    fit = fitted(Toy(lambda v: v[0] - data), (FIRST,), np.zeros(1), rounds=30)
    # the influence of soft L1 is at most ROBUST_SIGMAS, against which three samples pull back
    assert 0 < fit.u[0] < ROBUST_SIGMAS / 3 * 1.1
    assert fit.cost < cost_at((FIRST,), np.array([10.0]), 10.0 - data)


def test_bounds_are_kept_and_a_prior_determines_what_the_residuals_do_not():
    positive = Unknown("strength", 1.0, sd=10.0, low=0.0, high=8.0)
    known = Unknown("known", 1.0, kind="linear", mean=2.0, sd=0.5)
    fit = fitted(Toy(lambda v: np.array([v[0] + 3.0, 0 * v[1]])), (positive, known), np.array([1.0, 0.0]), rounds=30)
    assert fit.u[0] == pytest.approx(0.0, abs=1e-6)
    assert fit.u[1] == pytest.approx(2.0, abs=1e-6)


def test_a_table_has_a_roughness_penalty():
    data = np.array([0.0, 1.0, 0.0])
    table = tuple(Unknown(f"point.{n}", 1.0, kind="linear", sd=100.0) for n in range(3))
    second = np.array([[-1.0, 2.0, -1.0]])
    free = fitted(Toy(lambda v: np.array(v) - data), table, np.zeros(3), rounds=30)
    smooth = fitted(Toy(lambda v: np.array(v) - data), table, np.zeros(3), rounds=30, smooth=10 * second)
    assert abs(second @ free.u) > 1.9
    assert abs(second @ smooth.u) < 0.1
    assert smooth.cost == pytest.approx(cost_at(table, smooth.u, smooth.residual, 10 * second))


def test_fits_side_by_side_end_where_each_ends_by_itself_and_ask_for_points_together():
    toy = Toy(lambda v: np.array([10 * (v[1] - v[0] ** 2), 1 - v[0]]))
    starts = [((FIRST, SECOND), np.array(at)) for at in ((-1.2, 1.0), (0.9, 0.8), (2.0, -3.0))]
    toys = [Toy(toy.formula) for _ in starts]
    alone = [fitted(one, *start, rounds=50) for one, start in zip(toys, starts, strict=True)]
    asked, at = [], toy.at
    toy.at = lambda points: asked.append(len(points)) or at(points)
    assert [fit.cost for fit in fits_from(toy, starts, rounds=50)] == [fit.cost for fit in alone]
    assert len(asked) == max(one.asked for one in toys)
    assert sum(asked) == sum(one.asked for one in toys)


def test_a_brief_fit_ends_at_the_same_point_without_derivatives_there():
    toy, whole = (Toy(lambda v: np.array([10 * (v[1] - v[0] ** 2), 1 - v[0]])) for _ in range(2))
    start = (FIRST, SECOND), np.array([0.9, 0.8])
    (brief,) = fits_from(toy, [start], rounds=2, brief=True)
    fit = fitted(whole, *start, rounds=2)
    assert (brief.cost, brief.u.tolist()) == (fit.cost, fit.u.tolist())
    assert (toy.asked, toy.differentiated) == (whole.asked, whole.differentiated - 1)


def test_a_step_is_differentiated_when_it_is_tried_unless_the_one_before_it_gained_nothing():
    even = Toy(lambda v: np.array([v[0] - 3, 2 * (v[1] + 1)]))
    fitted(even, (FIRST, SECOND), np.zeros(2), rounds=30)
    assert even.asked == even.differentiated
    asked, toy = [], Toy(lambda v: np.array([10 * (v[1] - v[0] ** 2), 1 - v[0]]))
    toy.at = lambda points: asked.extend(points) or Toy.at(toy, points)
    fitted(toy, (FIRST, SECOND), np.array([-1.2, 1.0]), rounds=50)
    costs = [cost_at(one.unknowns, one.u, toy._of(one.unknowns, one.u)) for one in asked]
    tried = [k for k in range(1, len(asked)) if asked[k].u.tolist() != asked[k - 1].u.tolist()]
    gained = {k: costs[k] < min(costs[:k]) for k in tried}
    assert not all(gained.values())
    assert [asked[k].derivatives for k in tried[1:]] == [gained[k] for k in tried[:-1]]


def test_a_fit_that_is_stopped_returns_the_best_point_so_far():
    toy = Toy(lambda v: np.array([10 * (v[1] - v[0] ** 2), 1 - v[0]]), stops_after=4)
    start = np.array([-1.2, 1.0])
    fit = fitted(toy, (FIRST, SECOND), start, rounds=50)
    begun = cost_at((FIRST, SECOND), start, Toy(toy.formula).residuals((FIRST, SECOND), [start])[0])
    assert toy.asked <= 6
    assert 0.1 < fit.cost < begun  # neither the minimum nor the start
