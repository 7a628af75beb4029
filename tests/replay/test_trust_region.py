"""Steps within bounds and a trust region: as short and as good as a general minimiser's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from straw.replay.diagnose.trust_region import bounded_step, promised, resized

EVERYWHERE = np.full(4, np.inf)


def drawn(seed):
    """A well-conditioned least-squares problem: rows (9, 4), right-hand side (9,), its Hessian and gradient at zero."""
    rng = np.random.default_rng(seed)
    rows, right = rng.normal(size=(9, 4)), 3 * rng.normal(size=9)
    return rows, right, rows.T @ rows, -rows.T @ right


@pytest.mark.parametrize("seed", range(5))
def test_a_step_within_bounds_gains_nearly_what_the_best_one_there_does(seed):
    rows, right, H, g = drawn(seed)
    low, high = np.array([-0.1, -np.inf, 0.0, -2.0]), np.array([0.1, np.inf, 5.0, 2.0])
    step = bounded_step(H, g, low, high, np.inf)
    assert (low <= step).all()
    assert (step <= high).all()
    best = lsq_linear(rows, right, (low, high)).x
    # what once passes a bound stays there, so that the step may be a little less good than the best
    assert 0.9 * promised(H, g, best) <= promised(H, g, step) <= promised(H, g, best) + 1e-9


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("radius", [0.05, 0.5])
def test_a_step_within_a_radius_is_the_best_one_there(seed, radius):
    _, _, H, g = drawn(seed)
    step = bounded_step(H, g, -EVERYWHERE, EVERYWHERE, radius)
    within = {"type": "ineq", "fun": lambda s: radius**2 - s @ s}
    best = minimize(lambda s: -promised(H, g, s), np.zeros(4), constraints=[within], method="SLSQP").x
    assert np.linalg.norm(step) <= radius * (1 + 1e-9)
    assert promised(H, g, step) == pytest.approx(promised(H, g, best), rel=1e-2)


def test_a_long_radius_gives_the_newton_step():
    _, _, H, g = drawn(0)
    np.testing.assert_allclose(bounded_step(H, g, -EVERYWHERE, EVERYWHERE, 1e3), -np.linalg.solve(H, g), rtol=1e-9)


def test_the_region_shrinks_after_a_poor_step_grows_after_a_good_long_one_and_else_stays():
    long = np.array([0.6, 0.8])
    assert resized(1.0, long, gained=-5.0, expected=10.0) == pytest.approx(0.25)
    assert resized(1.0, long, gained=9.0, expected=10.0) == pytest.approx(2.0)
    assert resized(1.0, long, gained=5.0, expected=10.0) == pytest.approx(1.0)
    assert resized(1.0, long / 2, gained=9.0, expected=10.0) == pytest.approx(1.0)
