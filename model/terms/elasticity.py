"""Elastic frusta: Almen and Laszlo's disk spring, extended to antisymmetric deflection (equations 6a, 6b, 7).

F = 4 C1 zeta (2 zeta^2 - 2 zeta_0^2 + 3 r_i^2 phi^2) + 2 C2 (zeta - zeta_0)
M = r_i^2 phi [C1 (12 zeta^2 - 4 zeta_0^2 + 3 r_i^2 phi^2) + C2]
"""

from __future__ import annotations

import math

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.constants import Constants
from straw.model.term import Frustum
from straw.model.terms.shell_energy import SHARE, shell_energy, shell_force, shell_stiffness


@compiled
def elastic_force(zeta: float, phi: float, zeta0: float, C1: float, C2: float, r_i: float) -> tuple[float, float]:
    """-F on zeta (N) and -M on phi (N m)."""
    zeta2, z02, rphi2 = zeta**2, zeta0**2, (r_i * phi) ** 2
    force = 4 * C1 * zeta * (2 * zeta2 - 2 * z02 + 3 * rphi2) + 2 * C2 * (zeta - zeta0)
    moment = r_i**2 * phi * (C1 * (12 * zeta2 - 4 * z02 + 3 * rphi2) + C2)
    return -force, -moment


@compiled
def elastic_energy(zeta: float, phi: float, zeta0: float, C1: float, C2: float, r_i: float) -> float:
    """Energy (J) that F and M derive from, zero at the unloaded shape."""
    zeta2, z02, rphi2 = zeta**2, zeta0**2, (r_i * phi) ** 2
    energy = C1 * (2 * (zeta2 - z02) ** 2 + rphi2 * (6 * zeta2 - 2 * z02) + 0.75 * rphi2**2)
    return float(energy + C2 * ((zeta - zeta0) ** 2 + rphi2 / 2))


@allocates_nothing
def walls_force_at(zeta: float, phi: float, f: Frustum) -> tuple[float, float]:
    """-F on zeta and -M on phi of a frustum's walls there, by equation 7 or by finite elements where it has them."""
    if f.wall[0] == 0:
        return elastic_force(zeta, phi, f.zeta0, f.C1, f.C2, f.r_i)
    force, moment = shell_force(zeta, phi, f.r_i, f.wall)
    share = f.wall[SHARE]
    if share == 1:
        return force, moment
    other, turning = elastic_force(zeta, phi, f.zeta0, f.C1, f.C2, f.r_i)
    return share * force + (1 - share) * other, share * moment + (1 - share) * turning


@exposed
def walls_force(f: Frustum) -> tuple[float, float]:
    """-F on zeta and -M on phi of a frustum's walls where it is."""
    return walls_force_at(f.zeta, f.phi, f)


@compiled
def walls_energy_at(zeta: float, phi: float, f: Frustum) -> float:
    """Energy (J) that `walls_force_at` derives from."""
    if f.wall[0] == 0:
        return elastic_energy(zeta, phi, f.zeta0, f.C1, f.C2, f.r_i)
    share = f.wall[SHARE]
    other = elastic_energy(zeta, phi, f.zeta0, f.C1, f.C2, f.r_i)
    return float(share * shell_energy(zeta, phi, f.r_i, f.wall) + (1 - share) * other)


@compiled
def walls_energy(f: Frustum) -> float:
    """Energy (J) that `walls_force` derives from."""
    return walls_energy_at(f.zeta, f.phi, f)


@compiled
def softest(c: Constants) -> float:
    """Least stiffness of a frustum that may move, in its unloaded shape, N/m."""
    least = math.inf
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            if c.wall[i, j, 0] > 0:
                least = min(least, shell_stiffness(c.zeta0[i, j], 0.0, c.r_i, c.wall[i, j])[0])
            else:
                least = min(least, 16 * c.C1[i, j] * c.zeta0[i, j] ** 2 + 2 * c.C2[i, j])
    return float(least)
