"""One frustum: its nine equilibria, its energy, and the pressures at which states appear and vanish."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mpf

from straw.model.errors import ModelError
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters
from tests.model.paper import PaperStraw

STRAW = StrawParameters()
ACTIVE = frustum_of(STRAW)
#: ../shared/paper/NOTES.md, mm and rad
STABLE = {(-2.2800, 0.0), (2.0248, 0.0), (-0.2735, 0.2196), (-0.2735, -0.2196)}
UNSTABLE = {(0.2552, 0.0), (-0.8014, 0.1727), (-0.8014, -0.1727), (1.0750, 0.1147), (1.0750, -0.1147)}
#: The same constants written out; the others that a straw of one cell needs do not enter its elastic energy.
PAPER = PaperStraw(1, r_i=11.1e-3, r_o=14.65e-3, E=0.92e9, h=0.508e-3, zeta0_odd=3.78e-3, zeta0_even=-2.28e-3)


def test_an_unloaded_frustum_has_the_nine_known_equilibria_four_of_them_stable() -> None:
    found = ACTIVE.equilibria()
    for stable, want in ((True, STABLE), (False, UNSTABLE)):
        got = {(round(e.zeta_m * 1e3, 4), round(e.phi_rad, 4)) for e in found if e.stable is stable}
        assert got == want


@pytest.mark.parametrize("phi", [0.0, 0.1])
@pytest.mark.parametrize("zeta", [-2e-3, 0.7e-3])
def test_the_energy_is_the_papers_and_force_and_stiffness_are_its_derivatives(zeta: float, phi: float) -> None:
    def energy(z: object, f: object) -> object:
        return PAPER.elastic([PAPER.zeta0_odd, z, mpf(0), f])

    z, f, e = mpf(zeta), mpf(phi), mpf(10) ** -12
    ours = float(ACTIVE.energy(np.array(zeta), np.array(phi)))
    assert ours == pytest.approx(float(energy(z, f) - energy(PAPER.zeta0_even, mpf(0))), rel=1e-9)
    F, M = ACTIVE.force(zeta, phi)
    assert pytest.approx(float((energy(z + e, f) - energy(z - e, f)) / (2 * e)), rel=1e-9) == F
    assert pytest.approx(float((energy(z, f + e) - energy(z, f - e)) / (2 * e)), rel=1e-9, abs=1e-15) == M
    r = float(PAPER.r_i)
    K = ACTIVE.stiffness(zeta, phi)
    mixed = energy(z + e, f + e) - energy(z + e, f - e) - energy(z - e, f + e) + energy(z - e, f - e)
    assert K[0, 1] == pytest.approx(r * float(mixed / (4 * e**2)), rel=1e-9, abs=1e-12)
    for i, (dz, df, unit) in enumerate(((e, mpf(0), r**2), (mpf(0), e, 1.0))):
        second = (energy(z + dz, f + df) - 2 * energy(z, f) + energy(z - dz, f - df)) / e**2
        assert K[i, i] == pytest.approx(unit * float(second), rel=1e-9)


@pytest.mark.parametrize("sealed", [False, True])
def test_four_pressures_separate_five_regions_of_one_two_four_two_and_one_stable_states(sealed: bool) -> None:
    frustum = frustum_of(STRAW, sealed=sealed)
    bounds = frustum.bifurcation_pressures()
    assert bounds[0] < bounds[1] < 0 < bounds[2] < bounds[3]
    just = 1e-3  # Pa; far below the distances between them, far above rounding
    inside = [p for bound in bounds for p in (bound - just, bound + just)]
    counts = [sum(e.stable for e in frustum.equilibria(p)) for p in inside]
    assert counts == [1, 2, 2, 4, 4, 2, 2, 1]
    (only,) = (e for e in frustum.equilibria(2 * bounds[0]) if e.stable)
    assert only.zeta_m < 0  # "in high negative pressure values the only stable state is the folded state"
    two = [e for e in frustum.equilibria((bounds[2] + bounds[3]) / 2) if e.stable]
    assert [(e.zeta_m > 0, e.phi_rad) for e in two] == [(True, 0.0), (False, 0.0)]  # both folded and deployed


def test_an_equilibrium_is_free_of_force_and_its_pressure_is_recovered() -> None:
    for e in ACTIVE.equilibria(12e3):
        F, M = ACTIVE.force(e.zeta_m, e.phi_rad, 12e3)
        assert abs(F) < 1e-10  # of C3 p = 1.6 N
        assert abs(M) < 1e-12
        assert ACTIVE.pressure_at(e.zeta_m, e.phi_rad) == pytest.approx(12e3, rel=1e-9)


def test_a_frustum_too_flat_to_snap_is_an_error() -> None:
    with pytest.raises(ModelError, match="one state only"):
        frustum_of(STRAW.replace(h_m=5e-3)).bifurcation_pressures()
