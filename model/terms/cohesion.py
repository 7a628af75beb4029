"""Cohesion between the folded faces: an attraction of finite range that each cycle weakens.

F = -F0 exp(-w cycle) exp(-(x / l)^2 / 2),  x = zeta + |zeta_0| the opening of the faces.
"""

from __future__ import annotations

import math

from model.compiled import compiled
from model.term import Constant, Floats, Frustum, Term


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    x = (f.zeta + abs(f.zeta0)) / k[1]
    return -k[0] * math.exp(-k[2] * f.cycle - x * x / 2), 0.0


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    x = (f.zeta + abs(f.zeta0)) / k[1]
    return float(k[0] * math.exp(-k[2] * f.cycle) * k[1] * math.sqrt(math.pi / 2) * math.erf(x / math.sqrt(2)))


TERM = Term(
    name="cohesion",
    kind="frustum",
    law="F = -F0 exp(-w cycle) exp(-(x/l)^2/2), x = zeta + |zeta_0|",
    source="Ilssar et al., section 4: faces that stick after folding, less with each cycle; Gaussian well: ours",
    strengths=("force_n",),
    constants=(
        Constant("force_n", "N", 0.0, 0.5, 10.0, "F0, largest attraction of a fresh specimen's frustum"),
        Constant("range_m", "m", 0.3e-3, 0.1e-3, 1e-3, "l, opening over which it acts"),
        Constant("weakening", "1", 0.0, 0.0, 1.0, "w, share lost in a cycle (natural logarithm)"),
    ),
    force=_force,
    energy=_energy,
)
