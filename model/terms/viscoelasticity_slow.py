"""A second, slower branch of a viscoelastic wall: real polymers relax over decades of time, one branch over one."""

from __future__ import annotations

from straw.model.term import Constant, Term
from straw.model.terms.viscoelasticity import TERM as FIRST

TERM = Term(
    name="viscoelasticity_slow",
    kind=FIRST.kind,
    law="s' = k2 zeta' - s/tau2, F = -s beside viscoelasticity's; b k2 r_i^2/2 for phi",
    source="generalised Maxwell solid (Prony series, a branch for each decade of time)",
    strengths=("slow_k1_n_per_m",),
    constants=(
        Constant("slow_k1_n_per_m", "N/m", 0.0, 100.0, 3000.0, "k2, relaxing part of the stiffness"),
        Constant("slow_tau_s", "s", 3.0, 0.2, 50.0, "tau2, relaxation time"),
        FIRST.constants[2],  # bending
    ),
    force=FIRST.force,
    cause=False,
)
