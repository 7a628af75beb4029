"""Linear damping of every coordinate (equation 4): D = sum c_zeta zeta'^2 / 2 + c_phi phi'^2 / 2."""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Frustum


@compiled
def damping_force(f: Frustum) -> tuple[float, float]:
    """-c_zeta zeta' on zeta (N) and -c_phi phi' on phi (N m)."""
    return -f.c_zeta * f.d_zeta, -f.c_phi * f.d_phi
