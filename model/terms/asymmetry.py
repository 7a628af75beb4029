"""Frusta that are not axisymmetric: one side snaps first, a moment of fixed sign between the two wells.

U = m phi B(x), B = (1 - x^2)^n within |x| < 1, x = (zeta / |zeta_0| - c) / w:  M = -m B,  F = -m phi B' / (w |zeta_0|).
Beyond it is zero: the lean of a straw at rest is intrinsic curvature's. n = 1 is a parabola, a large n
nearly a normal curve.
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    w = k[1] * abs(f.zeta0)
    x = (f.zeta - k[2] * abs(f.zeta0)) / w
    inside = 1 - x**2
    if inside <= 0:
        return 0.0, 0.0
    bump = k[0] * inside ** k[3]
    return 2 * k[3] * x / inside * bump * f.phi / w, -bump


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    x = (f.zeta / abs(f.zeta0) - k[2]) / k[1]
    return float(k[0] * f.phi * max(0.0, 1 - x**2) ** k[3])


TERM = Term(
    name="asymmetry",
    kind="frustum",
    law="U = m phi (1 - x^2)^n within |x| < 1, x = (zeta/|zeta_0| - c)/w",
    source="Ilssar et al., section 4: frusta are not perfectly axisymmetric; bump between the wells chosen here",
    strengths=("moment_n_m",),
    constants=(
        Constant("moment_n_m", "N m", 0.0, -0.02, 0.02, "m, moment where it is largest"),
        Constant("width", "1", 0.9, 0.2, 2.0, "w, where its bump ends, in |zeta_0|"),
        Constant("centre", "1", 0.0, -1.0, 1.0, "c, where it is largest, in |zeta_0|; 0 is half-way through a snap"),
        Constant("sharpness", "1", 2.0, 1.2, 8.0, "n, power of its bump"),
    ),
    force=_force,
    energy=_energy,
)
