"""Longitudinal curvature of the unloaded straw: each frustum's elasticity acts on phi - phi_0, whichever it has."""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term
from straw.model.terms.elasticity import walls_energy_at, walls_force_at


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    force, moment = walls_force_at(f.zeta, f.phi - k[0], f)
    base_force, base_moment = walls_force_at(f.zeta, f.phi, f)
    return force - base_force, moment - base_moment


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    return float(walls_energy_at(f.zeta, f.phi - k[0], f) - walls_energy_at(f.zeta, f.phi, f))


TERM = Term(
    name="intrinsic_curvature",
    kind="frustum",
    law="the walls' F and M (equations 6a, 6b or finite elements) with phi - phi_0 for phi",
    source="Ilssar et al., section 4: longitudinal curvature of the unloaded straw",
    strengths=("phi_0_rad",),
    constants=(Constant("phi_0_rad", "rad", 0.0, -0.05, 0.05, "phi_0, unloaded angle of a frustum"),),
    force=_force,
    energy=_energy,
)
