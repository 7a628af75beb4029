"""A second, slower branch of a viscoelastic wall: real polymers relax over decades of time, one branch over one."""

from __future__ import annotations

from model.compiled import compiled
from model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats, zeta_n: float, phi_n_m: float, step_s: float) -> tuple[float, float]:
    fade = 1 + step_s / k[1]
    return (
        (zeta_n + step_s * k[0] * f.d_zeta) / fade,
        (phi_n_m + step_s * k[0] * k[2] * f.r_i**2 / 2 * f.d_phi) / fade,
    )


TERM = Term(
    name="viscoelasticity_slow",
    kind="memory",
    law="s' = k2 zeta' - s/tau2, F = -s beside viscoelasticity's; b k2 r_i^2/2 for phi",
    source="generalised Maxwell solid (Prony series, a branch for each decade of time)",
    strengths=("slow_k1_n_per_m",),
    constants=(
        Constant("slow_k1_n_per_m", "N/m", 0.0, 100.0, 3000.0, "k2, relaxing part of the stiffness"),
        Constant("slow_tau_s", "s", 3.0, 0.2, 50.0, "tau2, relaxation time"),
        Constant("bending", "1", 1.0, 0.0, 2.0, "b, how much of it bending shares"),
    ),
    force=_force,
    cause=False,
)
