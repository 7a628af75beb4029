"""Viscoelastic wall: a standard linear solid's spring and dashpot in series, beside the elastic frustum.

s' = k1 zeta' - s / tau, F = -s;  for phi the same ring of springs at r_i: b k1 r_i^2 / 2, b = 1 where the wall relaxes
in bending as it does in stretching.
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats, zeta_n: float, phi_n_m: float, step_s: float) -> tuple[float, float]:
    fade = 1 + step_s / k[1]
    return (
        (zeta_n + step_s * k[0] * f.d_zeta) / fade,
        (phi_n_m + step_s * k[0] * k[2] * f.r_i**2 / 2 * f.d_phi) / fade,
    )


TERM = Term(
    name="viscoelasticity",
    kind="memory",
    law="s' = k1 zeta' - s/tau, F = -s; b k1 r_i^2/2 for phi (viscoelasticity_slow: one branch more)",
    source="standard linear solid (Zener); polypropylene creeps over seconds",
    strengths=("k1_n_per_m",),
    constants=(
        Constant("k1_n_per_m", "N/m", 0.0, 100.0, 3000.0, "k1, relaxing part of the stiffness"),
        Constant("tau_s", "s", 0.3, 0.02, 5.0, "tau, relaxation time"),
        Constant("bending", "1", 1.0, 0.0, 2.0, "b, share of it that acts on bending"),
    ),
    force=_force,
)
