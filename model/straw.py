"""The straw: the sum of its terms, as a residual, an acceleration and the quantities a rig can see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.compiled import compiled
from model.inertia import add_inertia, mass_matrix
from model.kinematics import chain_of, motion_of
from model.linear import factor, substitute
from model.load import no_load, project
from model.parameters import Constants
from model.terms.damping import add_damping
from model.terms.elasticity import add_elasticity
from model.terms.gravity import add_gravity
from model.terms.pressure import add_pressure, inside_pressure
from model.terms.tip_load import add_tip_load

Floats = NDArray[np.float64]


@compiled
def residual(c: Constants, q: Floats, v: Floats, a: Floats, external_pa: float) -> Floats:
    """Hamilton's principle for motion (q, v, a): generalised force left over, zero where a is the acceleration."""
    m = motion_of(c, q, v, a)
    s = chain_of(c, m)
    load = no_load(c.cells)
    add_inertia(c, s, load)
    add_elasticity(c, m, load)
    add_damping(c, m, load)
    add_gravity(c, s, load)
    add_pressure(c, m, s, external_pa, load)
    add_tip_load(c, load)
    return project(c, s, load)


@compiled
def mass_at(c: Constants, q: Floats) -> Floats:
    """Mass matrix at q, shape (coordinates, coordinates)."""
    still = np.zeros_like(q)
    return mass_matrix(c, chain_of(c, motion_of(c, q, still, still)))


@compiled
def acceleration(c: Constants, q: Floats, v: Floats, external_pa: float) -> Floats:
    """Second derivative of q: M(q)^-1 times all forces.

    Only the truncated form has one. In the full form each cell's fluid, a rigid body with three velocities, has four
    coordinates, so M has rank 3 (N + 1) at most, below 4 N from N = 4 on: inertia alone does not say how the
    coordinates accelerate, and what comes back is rounding error. `model.integrate` never divides by M.
    """
    M = mass_at(c, q)
    return substitute(M, factor(M), residual(c, q, v, np.zeros_like(q), external_pa))


@compiled
def pressure_at(c: Constants, q: Floats, v: Floats, external_pa: float) -> float:
    """Pressure inside the straw, Pa."""
    return inside_pressure(c, motion_of(c, q, v, v), external_pa)


@compiled
def volume_at(c: Constants, q: Floats) -> float:
    """Volume of the fluid inside the straw, m^3."""
    still = np.zeros_like(q)
    m = motion_of(c, q, still, still)
    return float(c.S * (m.zeta[:, 0].sum() + m.zeta[:, 1].sum()))


@compiled
def kinetic_energy_at(c: Constants, q: Floats, v: Floats) -> float:
    """Kinetic energy, J (equation 3)."""
    s = chain_of(c, motion_of(c, q, v, np.zeros_like(q)))
    energy = 0.0
    for i in range(c.cells + 1):
        energy += s.mass[i] * (s.velocity[i, 0] ** 2 + s.velocity[i, 1] ** 2) / 2 + s.inertia[i] * s.spin[i] ** 2 / 2
    return energy
