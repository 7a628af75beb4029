"""Frusta that are not axisymmetric: one side snaps first, a moment of fixed sign that peaks half-way.

U = m phi exp(-(zeta / w)^2 / 2), w = |zeta_0| / 2:  M = -m exp(..),  F = m phi zeta / w^2 exp(..).
"""

from __future__ import annotations

import math

from model.compiled import compiled
from model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    w = abs(f.zeta0) / 2
    bump = k[0] * math.exp(-((f.zeta / w) ** 2) / 2)
    return bump * f.phi * f.zeta / w**2, -bump


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    return float(k[0] * f.phi * math.exp(-((2 * f.zeta / f.zeta0) ** 2) / 2))


TERM = Term(
    name="asymmetry",
    kind="frustum",
    law="U = m phi exp(-(zeta/w)^2/2), w = |zeta_0|/2",
    source="Ilssar et al., section 4: frusta are not perfectly axisymmetric; a bump between the two wells: ours",
    strengths=("moment_n_m",),
    constants=(Constant("moment_n_m", "N m", 0.0, -0.02, 0.02, "m, moment half-way through a snap"),),
    force=_force,
    energy=_energy,
)
