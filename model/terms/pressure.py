"""Forces of the fluid's pressure: C3 p on every zeta (6a), pi r_i^2 p along the tip axis, a follower force (5)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, exposed
from straw.model.constants import Constants
from straw.model.kinematics import Chain
from straw.model.load import Load

Floats = NDArray[np.float64]


@allocates_nothing
def add_pressure(c: Constants, s: Chain, inside_pa: float, load: Load) -> None:
    """Add the pressure's force on the frusta and on the sealed end."""
    for i in range(c.cells):
        load.cell[i, 0] += c.C3 * inside_pa
        load.cell[i, 1] += c.C3 * inside_pa
    load.force[c.cells, 0] += math.pi * c.r_i**2 * inside_pa * s.tip_axis[0]
    load.force[c.cells, 1] += math.pi * c.r_i**2 * inside_pa * s.tip_axis[1]


@exposed
def pressure_per_pa(c: Constants, s: Chain, out: Floats) -> None:
    """Generalised force of one pascal inside, into out (coordinates,)."""
    n, k = c.cells, c.active
    end = math.pi * c.r_i**2
    fx, fz = end * s.tip_axis[0], end * s.tip_axis[1]
    for i in range(n):
        for j in range(k):
            joint = s.joint[i + j + 2 - k]
            out[j * n + i] = c.C3 + fx * s.u[i, 0] + fz * s.u[i, 1]
            out[(k + j) * n + i] = fx * (s.joint[n, 1] - joint[1]) - fz * (s.joint[n, 0] - joint[0])
