"""The fluid's pressure: Bernoulli loss in the channel (2), on each frustum (6a), on the sealed end (5).

p = p_external - rho / (2 pi^2 r_ch^4) V'|V'|;   C3 p on every zeta;   pi r_i^2 p along the tip axis, a follower force.
"""

from __future__ import annotations

import math

from model.compiled import compiled
from model.kinematics import Chain, Motion
from model.load import Load
from model.parameters import Constants


@compiled
def inside_pressure(c: Constants, m: Motion, external_pa: float) -> float:
    """Uniform pressure inside the straw, Pa (equation 2)."""
    flow = float(c.S * (m.d_zeta[:, 0].sum() + m.d_zeta[:, 1].sum()))
    return external_pa - c.loss * flow * abs(flow)


@compiled
def add_pressure(c: Constants, m: Motion, s: Chain, external_pa: float, load: Load) -> None:
    """Add the pressure's force on the frusta and on the sealed end."""
    p = inside_pressure(c, m, external_pa)
    for i in range(c.cells):
        load.cell[i, 0] += c.C3 * p
        load.cell[i, 1] += c.C3 * p
    load.force[c.cells, 0] += math.pi * c.r_i**2 * p * s.tip_axis[0]
    load.force[c.cells, 1] += math.pi * c.r_i**2 * p * s.tip_axis[1]
