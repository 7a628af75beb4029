"""Frusta that differ: elasticity with E (1 + e) and zeta_0 (1 + z) less that with E and zeta_0.

F = e F_w + (1 + e) (F_6(zeta_0 (1 + z)) - F_6(zeta_0)): F_w is what the walls do, of equation 6 or of finite elements,
to which E is a factor; how another unloaded height changes it is equation 6's for both.
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term
from straw.model.terms.elasticity import elastic_energy, elastic_force, walls_energy, walls_force


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0 and k[1] == 0:
        return 0.0, 0.0
    force, moment = walls_force(f)
    if k[1] == 0:
        return k[0] * force, k[0] * moment
    other, turning = elastic_force(f.zeta, f.phi, f.zeta0 * (1 + k[1]), f.C1, f.C2, f.r_i)
    own, own_turning = elastic_force(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i)
    return k[0] * force + (1 + k[0]) * (other - own), k[0] * moment + (1 + k[0]) * (turning - own_turning)


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    other = elastic_energy(f.zeta, f.phi, f.zeta0 * (1 + k[1]), f.C1, f.C2, f.r_i)
    own = elastic_energy(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i)
    return float(k[0] * walls_energy(f) + (1 + k[0]) * (other - own))


TERM = Term(
    name="frustum_spread",
    kind="frustum",
    law="the walls with E (1 + e), and zeta_0 (1 + z) as in equation 6, frustum by frustum",
    source="Ilssar et al., section 4: the fourth cell is weaker than the first",
    strengths=("E_relative", "zeta0_relative"),
    constants=(
        Constant("E_relative", "1", 0.0, -0.3, 0.3, "e, one value a frustum"),
        Constant("zeta0_relative", "1", 0.0, -0.05, 0.05, "z, one value a frustum"),
    ),
    force=_force,
    energy=_energy,
)
