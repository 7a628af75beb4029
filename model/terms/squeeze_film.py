"""Squeeze film: the water between two nearly touching frusta has to leave through a narrowing gap.

F = -c (g / h)^3 zeta',  M = -b c (g / h)^3 (r^2 / 2) phi',  h = g + (x + sqrt(x^2 + g^2)) / 2 - g / 2,
x = zeta + |zeta_0| the opening, r the mean radius; h = g at the folded rest state and h -> x + g / 2 beyond.
b = 1 for a narrow ring that is wet all round; less where water flows along the ring when the frusta tilt.
"""

from __future__ import annotations

import math

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    x, g = f.zeta + abs(f.zeta0), k[1]
    c = k[0] * (g / (g / 2 + (x + math.sqrt(x * x + g * g)) / 2)) ** 3
    r = (f.r_i + f.r_o) / 2
    return -c * f.d_zeta, -k[2] * c * r * r / 2 * f.d_phi


TERM = Term(
    name="squeeze_film",
    kind="frustum",
    law="F = -c (g/h)^3 zeta', M = -b c (g/h)^3 r^2/2 phi', h = g/2 + (x + sqrt(x^2 + g^2))/2, x = zeta + |zeta_0|",
    source="Stefan 1874, strip 2 pi mu R b^3 / h^3; roughness keeps a gap g open (the smooth maximum is chosen here)",
    strengths=("folded_n_s_per_m",),
    constants=(
        Constant("folded_n_s_per_m", "N s/m", 0.0, 20.0, 5000.0, "c, damping at the folded rest state"),
        Constant("gap_m", "m", 0.2e-3, 0.05e-3, 0.6e-3, "g, gap of the folded faces"),
        Constant("bending", "1", 1.0, 0.0, 2.0, "b, share of it that acts on bending"),
    ),
    force=_force,
)
