"""Dry friction of the wall: Dahl's model, Coulomb friction that sticks through a small elastic slip.

s' = (F_c zeta' - s |zeta'|) / l, F = -s;  unlike a smoothed sign function it holds at rest.
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats, zeta_n: float, phi_n_m: float, step_s: float) -> tuple[float, float]:
    slip = step_s / k[1]
    return (zeta_n + k[0] * slip * f.d_zeta) / (1 + slip * abs(f.d_zeta)), 0.0


TERM = Term(
    name="dry_friction",
    kind="memory",
    law="s' = (F_c zeta' - s |zeta'|)/l, F = -s",
    source="Dahl 1968; hysteresis that survives infinitely slow ramps",
    strengths=("force_n",),
    constants=(
        Constant("force_n", "N", 0.0, 0.1, 5.0, "F_c, friction of a frustum"),
        Constant("slip_m", "m", 20e-6, 2e-6, 200e-6, "l, slip before it slides"),
    ),
    force=_force,
)
