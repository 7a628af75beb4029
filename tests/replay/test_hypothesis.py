"""Hypotheses: what each changes in a straw or an instrument, and the bounds of its search."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.terms import CAUSES
from straw.model.terms.shell_energy import SHARE
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT, applied, base_unknowns
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.library import causes, hypothesis
from straw.replay.diagnose.systems.straw.system import StrawSystem

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)


def test_every_cause_of_the_contract_can_be_applied_to_a_straw_or_an_instrument():
    assert set(CAUSES) | set(MEASUREMENT) | {"odd_frusta_compliance"} == set(causes(9))
    for name in causes(9):
        what = hypothesis([name], 9)
        straw, instrument = applied(BASE, what.unknowns, np.array(what.starts[0]))
        changed = straw.form != BASE.form or bool(straw.terms) or instrument != Instrument()
        assert changed, name
        same, sound = applied(BASE, what.unknowns[:1], np.zeros(1))
        if what.unknowns[0].kind == "strength":
            assert sound == Instrument()
            assert same.constants().plain


def test_unknowns_return_the_value_they_start_from():
    assert Unknown("straw.r_ch_m", 0.1, 4e-4, "log").value(0.0) == 4e-4
    strength = Unknown("term.cohesion.force_n", 2.0)
    assert strength.value(strength.at(3.0)) == pytest.approx(6.0)
    assert strength.per_u(0.4) == pytest.approx((strength.value(0.4 + 1e-6) - strength.value(0.4 - 1e-6)) / 2e-6)


@pytest.mark.parametrize("cause", CAUSES)
def test_a_cause_can_be_applied_to_a_straw_everywhere_within_its_bounds(cause):
    what = hypothesis([cause], BASE.cells)
    for start in what.starts:
        for k, unknown in enumerate(what.unknowns):
            for bound in (unknown.low, unknown.high):
                if np.isfinite(bound):
                    applied(BASE, what.unknowns, np.array([*start[:k], bound, *start[k + 1 :]]))


def test_elasticity_and_geometry_stay_within_a_few_percent_of_what_is_given():
    ends = {k.target: (k.value(k.low), k.value(k.high)) for k in base_unknowns(BASE)}
    for name in ("E_pa", "h_m", "zeta01", "zeta02"):
        low, high = ends[f"straw.{name}"]
        assert 0.9 < low < 0.97
        assert 1.03 < high < 1.1


def test_curvature_may_grow_along_the_straw_and_relaxation_spare_the_bending():
    curled, slack = hypothesis(["intrinsic_curvature"], 9), hypothesis(["viscoelasticity"], 9)
    at = np.array([k.at(x) for k, x in zip(curled.unknowns, (2.0, 1.0, 0.0), strict=True)])
    phi_0 = np.array(applied(BASE, curled.unknowns, at)[0].terms["intrinsic_curvature"]["phi_0_rad"])
    np.testing.assert_allclose(phi_0, 3e-3 * (2.0 + np.linspace(-1, 1, 9)))
    terms = applied(BASE, slack.unknowns, np.array([1.0, 0.0, 1.0, 0.0, 0.25]))[0].terms
    assert [terms[name]["bending"] for name in ("viscoelasticity", "viscoelasticity_slow")] == [0.25, 0.25]


def test_odd_frusta_may_be_stiffer_than_even_ones_beside_any_other_change():
    what = (*base_unknowns(BASE), *hypothesis(["odd_frusta_compliance"], 9).unknowns)
    at = [0.0] * 7 + [1.0, np.log(3.0)]
    at[3] = 1.0  # E, all frusta
    straw = applied(BASE, what, np.array(at))[0]
    assert straw.form == "full"
    np.testing.assert_allclose(straw.E_pa[:, 0], 3 * straw.E_pa[:, 1])
    np.testing.assert_allclose(straw.E_pa[:, 1], np.exp(0.02) * BASE.E_pa[0, 1])


def test_walls_of_another_elasticity_are_a_cause_where_finite_elements_of_the_geometry_exist():
    assert "wall_elasticity" in StrawSystem(BASE).causes
    assert "wall_elasticity" in StrawSystem(BASE.replace(elasticity="shell")).causes
    for other in (
        BASE.replace(r_o_m=15.2e-3),
        BASE.replace(h_m=np.array(0.46e-3), zeta0_m=np.array([3.78e-3, -2.2e-3])),
    ):
        system = StrawSystem(other)
        assert "wall_elasticity" not in system.causes
        assert any("straw shell" in doubt for doubt in system.doubts([]))


def test_a_share_of_one_is_the_other_elasticity():
    (share,), other = hypothesis(["wall_elasticity"], 9).unknowns, BASE.replace(elasticity="shell")
    u = np.array([share.at(1 / share.scale)])
    walls = [applied(straw, (share,), u)[0].constants().wall for straw in (BASE, other)]
    np.testing.assert_allclose(walls[0], other.constants().wall)
    assert np.abs(walls[1][:, :, SHARE]).max() < 1e-12


def test_a_pair_has_the_same_name_in_either_order_of_its_causes():
    one, other = hypothesis(["camera_roll"], 9), hypothesis(["trapped_gas"], 9)
    names = {one.beside(other).name, other.beside(one).name, hypothesis(["camera_roll", "trapped_gas"], 9).name}
    assert names == {"trapped_gas+camera_roll"}  # physics first
