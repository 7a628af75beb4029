"""A formula with a constant inside it, such as where a kink lies: found with its deviation, between grid and points."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import cost_at, fitted
from straw.replay.diagnose.formula import Formula
from straw.replay.diagnose.formula_fit import formula
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.states import STATES

STATE = next(s for s in STATES if s.name == "tip X, along X")
SLOPE, KINK, SIGMA = -84.0, 43.6e-3, 0.01  # N/m, m, N
X = np.linspace(30e-3, 60e-3, 2000)
AT = 1e-3 * np.array([30, 36, 40, 42.9, 43.2, 43.5, 43.8, 44.1, 48, 54, 60])  # moved to where the curve bends


class Measured:
    """Readings of a force over X beside an unknown constant force, which is the base's."""

    base = (Unknown("force.constant", 0.1, kind="linear", sd=10.0),)

    def __init__(self, seed: int) -> None:
        self.seen = SLOPE * np.maximum(0.0, X - KINK) + np.random.default_rng(seed).normal(0.3, SIGMA, len(X))

    def size(self, _recording: Any, _level: Any) -> int:
        return len(X)

    def misfit(self, _recording: Any, unknowns: Any, u: Any, **_: Any) -> Any:
        base, curve = unknowns[0], unknowns[1:]
        table = np.stack([np.interp(X, AT, one) for one in np.eye(len(AT))], axis=1)
        values = np.array([k.value(v) for k, v in zip(curve, u[1:], strict=True)])
        per_u = np.array([k.per_u(v) for k, v in zip(curve, u[1:], strict=True)])
        vector = (base.value(u[0]) + table @ values - self.seen) / SIGMA
        jacobian = np.column_stack([np.full(len(X), base.scale), table * per_u]) / SIGMA
        return SimpleNamespace(vector=vector, jacobian=jacobian, steps=1)


def found(seed: int) -> Formula:
    system: Any = Measured(seed)
    curve = tuple(Unknown(f"curve.{n}", 0.1, kind="linear", sd=100.0) for n in range(len(AT)))
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign([SimpleNamespace(name="run")], system, pool)  # type: ignore[list-item]
        unknowns = (*system.base, *curve)
        fit = fitted(campaign, unknowns, np.zeros(len(unknowns)), rounds=10)
        (none,) = campaign.residuals(unknowns, [np.zeros(len(unknowns))])
        smooth = np.zeros((1, len(unknowns)))
        chosen, a, sigmas, keeps = formula(
            campaign, fit, 1, smooth, AT, atoms(STATE, AT), cost_at(unknowns, np.zeros(len(unknowns)), none)
        )
    return Formula("F(X)", chosen, a, sigmas, ("N/m",), keeps)


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
