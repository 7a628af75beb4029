"""A share between equation 7 and finite elements, as used by a straw, its terms and a direction."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.direction import Direction
from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.given import given, linearised
from straw.model.parameters import StrawParameters
from straw.model.term import Frustum
from straw.model.terms import TERMS
from straw.model.terms.elasticity import elastic_force, walls_force
from straw.model.terms.shell_energy import shell_force

EQUATION_7, SHELL = StrawParameters(cells=2), StrawParameters(cells=2, elasticity="shell")
STATES = ((-2.0e-3, 0.03), (0.3e-3, 0.15), (2.1e-3, -0.02))
STILL = Table(0.0, 1.0, np.zeros(2))


def frustum(straw: StrawParameters, zeta: float, phi: float, row: np.ndarray | None = None) -> Frustum:
    c = straw.constants()
    own = float(c.zeta0[1, 1]), float(c.C1[1, 1]), float(c.C2[1, 1]), 0.0, 0.0, c.r_i, c.r_o, 0.0
    return Frustum(zeta, phi, 0.0, 0.0, *own, c.wall[1, 1] if row is None else row)


def test_a_share_leads_from_the_files_elasticity_to_the_other() -> None:
    there, back = (straw.with_term("wall_elasticity", share=0.3) for straw in (EQUATION_7, SHELL))
    for at in STATES:
        reduced, shell = (np.array(walls_force(frustum(straw, *at))) for straw in (EQUATION_7, SHELL))
        np.testing.assert_allclose(walls_force(frustum(there, *at)), 0.7 * reduced + 0.3 * shell, rtol=1e-12)
        np.testing.assert_allclose(walls_force(frustum(back, *at)), 0.3 * reduced + 0.7 * shell, rtol=1e-12)


@pytest.mark.parametrize("straw", [EQUATION_7, SHELL, EQUATION_7.with_term("wall_elasticity", share=0.4)])
def test_a_direction_along_the_share_has_the_derivative_of_the_walls_also_at_a_share_of_zero(
    straw: StrawParameters,
) -> None:
    """Exactly the difference of both energies' forces, by the rows and steps given to the columns."""
    at_zero = straw.terms.get("wall_elasticity", {}).get("share", 0.0)
    between = Direction.between(straw, straw.with_term("wall_elasticity", share=at_zero + 1e-3), 1e-3)
    sign = -1.0 if straw is SHELL else 1.0
    for direction in (between, Direction.of(straw, "terms.wall_elasticity.share")):
        moved, rows = given(straw, STILL, [direction]), linearised(straw, [direction]).wall
        assert moved.wall_cell.tolist() == [0, 1]
        row, way, e = rows[1, 1], moved.wall_by[1], float(moved.wall_step[1])
        for at in STATES:
            up, down = (np.array(walls_force(frustum(straw, *at, row + s * e * way))) for s in (1, -1))
            f = frustum(straw, *at)
            wanted = np.subtract(shell_force(*at, f.r_i, row), elastic_force(*at, f.zeta0, f.C1, f.C2, f.r_i))
            np.testing.assert_allclose((up - down) / (2 * e), sign * wanted, rtol=1e-6, atol=1e-9)


def test_differences_between_cells_and_curvature_apply_to_the_walls_the_straw_has() -> None:
    softer = TERMS["frustum_spread"].force
    curved = TERMS["intrinsic_curvature"].force
    for straw in (EQUATION_7, SHELL):
        for zeta, phi in STATES:
            f = frustum(straw, zeta, phi)
            own = np.array(walls_force(f))
            np.testing.assert_allclose(softer(f, np.array([-0.08, 0.0])), -0.08 * own, rtol=1e-12)
            turned = np.array(walls_force(frustum(straw, zeta, phi - 4e-3)))
            np.testing.assert_allclose(curved(f, np.array([4e-3])), turned - own, atol=1e-12)


def test_a_missing_stiffness_is_a_share_of_the_walls_the_straw_has() -> None:
    missing = TERMS["missing_force"]
    k = np.array([c.default for c in missing.constants])
    k[0] = 1.0
    names = [c.name for c in missing.constants]
    k[[i for i, name in enumerate(names) if name.startswith("stiffness_")]] = -0.08
    for straw in (EQUATION_7, SHELL, EQUATION_7.with_term("wall_elasticity", share=0.4)):
        for at in STATES:
            f = frustum(straw, *at)
            np.testing.assert_allclose(missing.force(f, k), -0.08 * np.array(walls_force(f)), rtol=1e-12)


@pytest.mark.parametrize("straw", [EQUATION_7, SHELL, EQUATION_7.with_term("wall_elasticity", share=0.4)])
def test_forces_of_terms_on_the_walls_are_derivatives_of_their_energies(straw: StrawParameters) -> None:
    for name, k in (("frustum_spread", (-0.08, 0.02)), ("intrinsic_curvature", (4e-3,))):
        term, dz, df = TERMS[name], 1e-8, 1e-6
        for zeta, phi in STATES:

            def energy(a: float, b: float) -> float:
                return float(term.energy(frustum(straw, a, b), np.array(k)))  # noqa: B023

            slope = (
                (energy(zeta + dz, phi) - energy(zeta - dz, phi)) / (2 * dz),
                (energy(zeta, phi + df) - energy(zeta, phi - df)) / (2 * df),
            )
            force = term.force(frustum(straw, zeta, phi), np.array(k))
            np.testing.assert_allclose(force, np.negative(slope), rtol=1e-5, atol=1e-6)


def test_a_share_of_walls_without_a_finite_element_table_is_refused() -> None:
    with pytest.raises(ModelError, match=r"r_o_m.*straw shell"):
        StrawParameters(r_o_m=15.2e-3).with_term("wall_elasticity", share=0.5)
    StrawParameters(r_o_m=15.2e-3).with_term("wall_elasticity", share=0.0)
