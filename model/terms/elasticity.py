"""Elastic frusta: Almen and Laszlo's disk spring, extended to antisymmetric deflection (equations 6a, 6b, 7).

F = 4 C1 zeta (2 zeta^2 - 2 zeta_0^2 + 3 r_i^2 phi^2) + 2 C2 (zeta - zeta_0)
M = r_i^2 phi [C1 (12 zeta^2 - 4 zeta_0^2 + 3 r_i^2 phi^2) + C2]
"""

from __future__ import annotations

from model.compiled import compiled
from model.kinematics import Motion
from model.load import Load
from model.parameters import Constants


@compiled
def add_elasticity(c: Constants, m: Motion, load: Load) -> None:
    """Add -F to each zeta and -M to each phi."""
    r2 = c.r_i**2
    for i in range(c.cells):
        for k in range(2):
            zeta, phi, zeta0, C1, C2 = m.zeta[i, k], m.phi[i, k], c.zeta0[i, k], c.C1[i, k], c.C2[i, k]
            load.cell[i, k] -= 4 * C1 * zeta * (2 * zeta**2 - 2 * zeta0**2 + 3 * r2 * phi**2) + 2 * C2 * (zeta - zeta0)
            load.cell[i, 2 + k] -= r2 * phi * (C1 * (12 * zeta**2 - 4 * zeta0**2 + 3 * r2 * phi**2) + C2)
