"""Cohesion between the folded faces: an attraction of finite range that each cycle weakens.

F = -F0 a exp(-((x - b) / l)^2 / 2),  x = zeta + |zeta_0| the opening of the faces, with l r in place of l below b, as
faces that are pulled apart resist at once and let go slowly;  a = (1 + s w cycle)^(-1/s), exp(-w cycle) where s = 0.
"""

from __future__ import annotations

import math

from straw.model.compiled import compiled
from straw.model.term import Constant, Floats, Frustum, Term


@compiled
def _left(w: float, slows: float, cycle: float) -> float:
    """Share that is left of the attraction after some cycles."""
    if abs(slows * w * cycle) < 1e-6:
        return math.exp(-w * cycle * (1 - slows * w * cycle / 2))
    return float((1 + slows * w * cycle) ** (-1 / slows))


@compiled
def _beyond(f: Frustum, k: Floats) -> tuple[float, float]:
    """How far the faces are open beyond where they pull most, in ranges, and the range (m) on that side."""
    x = f.zeta + abs(f.zeta0) - k[3]
    length = k[1] * k[5] if x < 0 else k[1]
    return x / length, length


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0:
        return 0.0, 0.0
    x, _ = _beyond(f, k)
    return -k[0] * _left(k[2], k[4], f.cycle) * math.exp(-x * x / 2), 0.0


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    x, length = _beyond(f, k)
    most = k[0] * _left(k[2], k[4], f.cycle)
    return float(most * length * math.sqrt(math.pi / 2) * math.erf(x / math.sqrt(2)))


TERM = Term(
    name="cohesion",
    kind="frustum",
    law="F = -F0 (1 + s w cycle)^(-1/s) exp(-((x - b)/l)^2/2), x = zeta + |zeta_0|, l r below b",
    source="Ilssar et al., section 4: faces that stick after folding, less with each cycle; Gaussian well chosen here",
    strengths=("force_n",),
    constants=(
        Constant("force_n", "N", 0.0, 0.5, 10.0, "F0, largest attraction of a fresh specimen's frustum"),
        Constant("range_m", "m", 0.3e-3, 0.1e-3, 1e-3, "l, opening over which it acts"),
        Constant("weakening", "1", 0.0, 0.0, 1.0, "w, share lost in the first cycle (natural logarithm)"),
        Constant("peak_m", "m", 0.0, 0.0, 1e-3, "b, opening at which it pulls most"),
        Constant("slows", "1", 0.0, 0.0, 3.0, "s, how much later cycles weaken it less; 0: as the first"),
        Constant("rises", "1", 1.0, 0.05, 1.0, "r, range below b over that beyond it"),
    ),
    force=_force,
    energy=_energy,
)
