"""A formula with a constant inside it, such as where a kink lies: found with its deviation, between grid and points."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag

from straw.replay.diagnose import formed
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import cost_at, fitted
from straw.replay.diagnose.formula import Atom, Formula, Sum
from straw.replay.diagnose.formula_fit import Written, as_good, formula
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.states import STATES

STATE = next(s for s in STATES if s.name == "tip X, along X")
SLOPE, KINK, SIGMA = -84.0, 43.6e-3, 0.01  # N/m, m, N
X = np.linspace(30e-3, 60e-3, 2000)
AT = 1e-3 * np.array([30, 36, 40, 42.9, 43.2, 43.5, 43.8, 44.1, 48, 54, 60])  # moved to where the curve bends


class Measured:
    """Readings of a law over a state beside an unknown constant, which is the base's."""

    base = (Unknown("force.constant", 0.1, kind="linear", sd=10.0),)

    def __init__(self, x: np.ndarray, at: np.ndarray, truth: np.ndarray, seed: int) -> None:
        self.seen = truth + np.random.default_rng(seed).normal(0.3, SIGMA, len(x))
        self.table = np.stack([np.interp(x, at, one) for one in np.eye(len(at))], axis=1)

    def size(self, _recording: Any, _level: Any) -> int:
        return len(self.seen)

    def misfit(self, _recording: Any, unknowns: Any, u: Any, **_: Any) -> Any:
        base, curve = unknowns[0], unknowns[1:]
        values = np.array([k.value(v) for k, v in zip(curve, u[1:], strict=True)])
        per_u = np.array([k.per_u(v) for k, v in zip(curve, u[1:], strict=True)])
        vector = (base.value(u[0]) + self.table @ values - self.seen) / SIGMA
        jacobian = np.column_stack([np.full(len(vector), base.scale), self.table * per_u]) / SIGMA
        return SimpleNamespace(vector=vector, jacobian=jacobian, work=1, plain=vector * SIGMA)


def written(system: Any, state: Any, at: np.ndarray, pool: Any) -> tuple[Written, Campaign]:
    curve = tuple(Unknown(f"curve.{n}", 0.1, kind="linear", sd=1000.0) for n in range(len(at)))
    campaign = Campaign([SimpleNamespace(name="run")], system, pool)  # type: ignore[list-item]
    unknowns = (*system.base, *curve)
    fit = fitted(campaign, unknowns, np.zeros(len(unknowns)), rounds=10)
    (none,) = campaign.residuals(unknowns, [np.zeros(len(unknowns))])
    smooth, null_cost = np.zeros((1, len(unknowns))), cost_at(unknowns, np.zeros(len(unknowns)), none)
    return formula(campaign, fit, 1, smooth, at, atoms(state, at), null_cost), campaign


def found(seed: int) -> Formula:
    system = Measured(X, AT, SLOPE * np.maximum(0.0, X - KINK), seed)
    with ThreadPoolExecutor(1) as pool:
        one = written(system, STATE, AT, pool)[0]
    return Formula("F(X)", one.atoms, one.coefficients, one.deviations, ("N/m",), one.keeps)


def test_a_kink_is_found_where_it_is_not_at_a_point_of_the_table():
    law = found(1)
    (atom,) = law.atoms
    assert atom.shape is not None
    assert atom.text.startswith("max(0, X - (43.6 ± 0.0")
    assert atom.shape.value == pytest.approx(KINK, abs=5 * atom.shape.sigma)
    assert law.coefficients[0] == pytest.approx(SLOPE, abs=5 * law.sigmas[0])
    assert law.keeps > 0.99
    assert f"max(0.0, x - {atom.shape.value:.6g})" == atom.code


def test_stated_deviations_of_slope_and_kink_are_those_between_repeats():
    laws = [found(seed) for seed in range(20)]
    kinks = [law.atoms[0].shape for law in laws]
    off = np.array([(law.coefficients[0] - SLOPE) / law.sigmas[0] for law in laws])
    places = np.array([(one.value - KINK) / one.sigma for one in kinks if one])
    for z in (off, places):
        assert 5.9 < np.sum(z**2) < 45.3  # with probability 0.998 for 20 squares of unit variance


def test_a_law_with_a_kink_on_either_side_of_zero_is_written_as_both_and_nothing_else():
    state = next(s for s in STATES if s.name == "gauge over pressure")
    p = np.linspace(-25e3, 35e3, 2000)
    at = np.array([-25e3, -20.5e3, -19.5e3, -10e3, 10e3, 29.5e3, 30.5e3, 35e3])
    truth = -8e-3 * np.maximum(0.0, p - 30e3) + 4e-3 * np.maximum(0.0, -20e3 - p)
    with ThreadPoolExecutor(1) as pool:
        one = written(Measured(p, at, truth, 3), state, at, pool)[0]
    law = Formula("error(p)", one.atoms, one.coefficients, one.deviations, ("Pa/Pa", "Pa/Pa"), one.keeps)
    assert "max(0, p - (3e+04 ± " in law.text
    assert "max(0, (-2e+04 ± " in law.text
    assert law.coefficients == pytest.approx([-8e-3, 4e-3], abs=5 * float(law.sigmas.max()))


def test_a_formulas_model_predicts_what_the_values_of_its_curve_do_on_any_of_the_runs():
    truth = SLOPE * np.maximum(0.0, X - KINK)
    with ThreadPoolExecutor(1) as pool:
        one, campaign = written(Measured(X, AT, truth, 1), STATE, AT, pool)
        model = one.model
        curves, u = model.parameters()
        ((by_curve,),) = campaign.misfits(curves, [u])
        ((alone,),) = model.campaign.only(["run"]).misfits(model.fit.unknowns, [model.fit.u])
    assert by_curve is not None
    assert alone is not None
    np.testing.assert_allclose(alone.vector, by_curve.vector, rtol=1e-12)
    # the curve of the formula is the law, beside the base's constant
    assert np.sqrt(np.mean((alone.plain + campaign.system.seen - truth - 0.3) ** 2)) < SIGMA / 5  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("cost", "numbers", "replaces"), [(100, 2, True), (219, 2, True), (221, 2, False), (221, 1, True)]
)
def test_each_constant_that_a_curve_has_more_than_its_formula_must_earn_a_share_of_the_gain(cost, numbers, replaces):
    assert as_good(1100.0, 100.0, 8, cost, numbers) == replaces


class Linear:
    """Residuals that are linear in the values of a base constant and of two curves of three points."""

    by = np.random.default_rng(2).normal(size=(9, 7))

    def size(self, _recording: Any, _level: Any) -> int:
        return len(self.by)

    def misfit(self, _recording: Any, unknowns: Any, u: Any, **_: Any) -> Any:
        values = np.array([k.value(v) for k, v in zip(unknowns, u, strict=True)])
        per_u = np.array([k.per_u(v) for k, v in zip(unknowns, u, strict=True)])
        return SimpleNamespace(vector=self.by @ values - 1.0, jacobian=self.by * per_u, work=1)


def test_two_curves_are_replaced_by_two_formulas_at_once_with_the_derivatives_of_both():
    at, system = np.array([1.0, 2.0, 4.0]), Linear()
    line, root = Atom("x", 1, lambda x, _: x), Atom("x^0.5", 0.5, lambda x, _: np.sqrt(x))
    sums = [Sum((line,), np.array([2.0]), at, np.ones(3)), Sum((line, root), np.array([-1.0, 3.0]), at, np.ones(3))]
    unknowns = tuple(Unknown(f"constant.{n}", 1.0, kind="linear", sd=100.0) for n in range(7))
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([SimpleNamespace(name="run")], system, pool)  # type: ignore[list-item, arg-type]
        model = formed.fitted(campaign, unknowns, np.array([0.5]), np.zeros((0, 1)), sums, 0)
    own = block_diag([[1.0]], np.outer(at, [2.0]), np.column_stack([-at, 3 * np.sqrt(at)]))
    assert model.parameters()[1] == pytest.approx(np.concatenate([[0.5], 2 * at, 3 * np.sqrt(at) - at]))
    np.testing.assert_allclose(model.fit.slopes, system.by @ own, rtol=1e-6)
    np.testing.assert_allclose(model.fit.residual, system.by @ model.parameters()[1] - 1.0, rtol=1e-12)
