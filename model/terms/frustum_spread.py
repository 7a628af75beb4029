"""Frusta that differ: elasticity (equations 6a, 6b) with E (1 + e) and zeta_0 (1 + z) less that with E and zeta_0."""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term
from straw.model.terms.elasticity import elastic_energy, elastic_force


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0 and k[1] == 0:
        return 0.0, 0.0
    force, moment = elastic_force(f.zeta, f.phi, f.zeta0 * (1 + k[1]), f.C1 * (1 + k[0]), f.C2 * (1 + k[0]), f.r_i)
    base_force, base_moment = elastic_force(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i)
    return force - base_force, moment - base_moment


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    energy = elastic_energy(f.zeta, f.phi, f.zeta0 * (1 + k[1]), f.C1 * (1 + k[0]), f.C2 * (1 + k[0]), f.r_i)
    return float(energy - elastic_energy(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i))


TERM = Term(
    name="frustum_spread",
    kind="frustum",
    law="equation 6 with E (1 + e) and zeta_0 (1 + z), frustum by frustum",
    source="Ilssar et al., section 4: the fourth cell is weaker than the first",
    strengths=("E_relative", "zeta0_relative"),
    constants=(
        Constant("E_relative", "1", 0.0, -0.3, 0.3, "e, one value a frustum"),
        Constant("zeta0_relative", "1", 0.0, -0.05, 0.05, "z, one value a frustum"),
    ),
    force=_force,
    energy=_energy,
)
