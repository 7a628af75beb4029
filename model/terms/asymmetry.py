"""Frusta that are not axisymmetric: one side snaps first, a moment of fixed sign that peaks half-way.

U = m phi exp(-x^2 / 2), x = (zeta / |zeta_0| - c) / w:  M = -m exp(..),  F = m phi x / (w |zeta_0|) exp(..).
"""

from __future__ import annotations

import math

from model.compiled import compiled
from model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    w = k[1] * abs(f.zeta0)
    x = (f.zeta - k[2] * abs(f.zeta0)) / w
    bump = k[0] * math.exp(-(x**2) / 2)
    return bump * f.phi * x / w, -bump


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    x = (f.zeta / abs(f.zeta0) - k[2]) / k[1]
    return float(k[0] * f.phi * math.exp(-(x**2) / 2))


TERM = Term(
    name="asymmetry",
    kind="frustum",
    law="U = m phi exp(-x^2/2), x = (zeta/|zeta_0| - c)/w",
    source="Ilssar et al., section 4: frusta are not perfectly axisymmetric; a bump between the two wells: ours",
    strengths=("moment_n_m",),
    constants=(
        Constant("moment_n_m", "N m", 0.0, -0.02, 0.02, "m, moment where it is largest"),
        Constant("width", "1", 0.5, 0.1, 1.0, "w, half width of its bump in |zeta_0|"),
        Constant("centre", "1", 0.0, -1.0, 1.0, "c, where it is largest, in |zeta_0|; 0 is half-way through a snap"),
    ),
    force=_force,
    energy=_energy,
)
