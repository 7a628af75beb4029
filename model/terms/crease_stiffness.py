"""Stiffness of the thin creases that join the frusta: springs about the unloaded shape that may harden.

F = -k_zeta (g + h g^3), g = zeta - zeta_0;  M = -k_phi (phi + b phi^3).
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    g = f.zeta - f.zeta0
    return -k[0] * (g + k[2] * g**3), -k[1] * (f.phi + k[3] * f.phi**3)


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    g2, phi2 = (f.zeta - f.zeta0) ** 2, f.phi**2
    return float(k[0] * (g2 / 2 + k[2] * g2**2 / 4) + k[1] * (phi2 / 2 + k[3] * phi2**2 / 4))


TERM = Term(
    name="crease_stiffness",
    kind="frustum",
    law="F = -k_zeta (g + h g^3), g = zeta - zeta_0, M = -k_phi (phi + b phi^3)",
    source="Ilssar et al., section 4: the thin creases' stiffness is left out; hinge, linear unless it hardens",
    strengths=("zeta_n_per_m", "phi_n_m_per_rad"),
    constants=(
        Constant("zeta_n_per_m", "N/m", 0.0, 20.0, 1000.0, "k_zeta; against 2 C2 = 1390 N/m"),
        Constant("phi_n_m_per_rad", "N m/rad", 0.0, 2e-3, 0.2, "k_phi; against r_i^2 C2 = 0.086 N m/rad"),
        Constant("hardens_per_m2", "1/m^2", 0.0, 0.0, 2e5, "h; 5e4 doubles it in a snap of 4.5 mm"),
        Constant("bending_hardens_per_rad2", "1/rad^2", 0.0, 0.0, 50.0, "b"),
    ),
    force=_force,
    energy=_energy,
)
