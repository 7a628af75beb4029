"""Stiffness of the thin creases that join the frusta: linear springs about the unloaded shape.

F = -k_zeta (zeta - zeta_0),  M = -k_phi phi.
"""

from __future__ import annotations

from model.compiled import compiled
from model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    return -k[0] * (f.zeta - f.zeta0), -k[1] * f.phi


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    return float(k[0] * (f.zeta - f.zeta0) ** 2 / 2 + k[1] * f.phi**2 / 2)


TERM = Term(
    name="crease_stiffness",
    kind="frustum",
    law="F = -k_zeta (zeta - zeta_0), M = -k_phi phi",
    source="Ilssar et al., section 4: the thin creases' stiffness is left out; linear hinge",
    strengths=("zeta_n_per_m", "phi_n_m_per_rad"),
    constants=(
        Constant("zeta_n_per_m", "N/m", 0.0, 20.0, 1000.0, "k_zeta; against 2 C2 = 1390 N/m"),
        Constant("phi_n_m_per_rad", "N m/rad", 0.0, 2e-3, 0.2, "k_phi; against r_i^2 C2 = 0.086 N m/rad"),
    ),
    force=_force,
    energy=_energy,
)
