"""Linear damping of every coordinate (equation 4): D = sum c_zeta zeta'^2 / 2 + c_phi phi'^2 / 2."""

from __future__ import annotations

from model.compiled import compiled
from model.kinematics import Motion
from model.load import Load
from model.parameters import Constants


@compiled
def add_damping(c: Constants, m: Motion, load: Load) -> None:
    """Add -c_zeta zeta' to each zeta and -c_phi phi' to each phi."""
    for i in range(c.cells):
        for k in range(2):
            load.cell[i, k] -= c.c_zeta[i, k] * m.d_zeta[i, k]
            load.cell[i, 2 + k] -= c.c_phi[i, k] * m.d_phi[i, k]
