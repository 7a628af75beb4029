"""Drag of the surrounding air, on each cell as a cylinder and on the board at the tip: grows with speed squared."""

from __future__ import annotations

import math

from straw.model.compiled import exposed
from straw.model.constants import Constants
from straw.model.kinematics import Chain
from straw.model.load import Load
from straw.model.term import Constant, Floats, Term


@exposed
def _force(c: Constants, k: Floats, s: Chain, load: Load) -> None:
    if k[0] == 0:
        return
    for i in range(c.cells + 1):
        area = k[2]
        if i < c.cells:
            area = 2 * c.r_o * s.mass[i] / (c.rho * c.S)
        drag = k[0] * k[1] / 2 * area * math.hypot(s.velocity[i, 0], s.velocity[i, 1])
        load.force[i, 0] -= drag * s.velocity[i, 0]
        load.force[i, 1] -= drag * s.velocity[i, 1]


TERM = Term(
    name="ambient_drag",
    kind="body",
    law="F = -c_d rho_f/2 A |v| v, A = 2 r_o L of a cell and the board's at the tip",
    source="quadratic drag (Hoerner); cylinder and plate across the wind c_d about 1.2",
    strengths=("c_d",),
    constants=(
        Constant("c_d", "1", 0.0, 0.3, 5.0, "drag coefficient"),
        Constant("fluid_kg_per_m3", "kg/m^3", 1.2, 1.0, 1000.0, "density of what surrounds the straw"),
        Constant("board_m2", "m^2", 6e-3, 0.0, 2e-2, "area of the board at the tip"),
    ),
    force=_force,
)
