"""Longitudinal curvature of the unloaded straw: each frustum's elasticity acts on phi - phi_0."""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term
from straw.model.terms.elasticity import elastic_energy, elastic_force


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    force, moment = elastic_force(f.zeta, f.phi - k[0], f.zeta0, f.C1, f.C2, f.r_i)
    base_force, base_moment = elastic_force(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i)
    return force - base_force, moment - base_moment


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    energy = elastic_energy(f.zeta, f.phi - k[0], f.zeta0, f.C1, f.C2, f.r_i)
    return float(energy - elastic_energy(f.zeta, f.phi, f.zeta0, f.C1, f.C2, f.r_i))


TERM = Term(
    name="intrinsic_curvature",
    kind="frustum",
    law="equations 6a, 6b with phi - phi_0 for phi",
    source="Ilssar et al., section 4: longitudinal curvature of the unloaded straw",
    strengths=("phi_0_rad",),
    constants=(Constant("phi_0_rad", "rad", 0.0, -0.05, 0.05, "phi_0, unloaded angle of a frustum"),),
    force=_force,
    energy=_energy,
)
