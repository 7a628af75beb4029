"""An unknown force or moment on the tip: tables over its position, its distance from a point, its angle and its speed.

F_X = a(X / L), F_Z = b(X / L) + d(Z / L), L the unloaded length with all cells deployed, r(R / L) towards a point P at
the distance R, h(|V|) along the tip's velocity, and a moment m(Phi).
"""

from __future__ import annotations

import math

from straw.model.compiled import exposed
from straw.model.constants import Constants
from straw.model.kinematics import Chain
from straw.model.load import Load
from straw.model.table import AMOUNT, empty, names, odd_table, points, table
from straw.model.term import Constant, Floats, Term


@exposed
def _force(c: Constants, k: Floats, s: Chain, load: Load) -> None:
    if k[0] == 0:
        return
    tip = c.cells
    if not (empty(k, 1) and empty(k, 17) and empty(k, 49) and empty(k, 81)):
        length = 0.0
        for i in range(c.cells):
            length += c.zeta0[i, 0] - c.zeta0[i, 1]
        load.force[tip, 0] += k[0] * table(s.position[tip, 0] / length, k, 1)
        load.force[tip, 1] += k[0] * table(s.position[tip, 0] / length, k, 17)
        load.force[tip, 1] += k[0] * table(s.position[tip, 1] / length, k, 49)
        away_x, away_z = k[97] - s.position[tip, 0] / length, k[98] - s.position[tip, 1] / length
        away = math.hypot(away_x, away_z)
        if away > 0 and not empty(k, 81):
            pull = k[0] * table(away, k, 81) / away
            load.force[tip, 0] += pull * away_x
            load.force[tip, 1] += pull * away_z
    if not empty(k, 33):
        speed = math.hypot(s.velocity[tip, 0], s.velocity[tip, 1])
        if speed > 0:
            along = k[0] * odd_table(speed, k, 33) / speed
            load.force[tip, 0] += along * s.velocity[tip, 0]
            load.force[tip, 1] += along * s.velocity[tip, 1]
    if not empty(k, 65):
        load.torque[tip] += k[0] * table(s.tip_angle[0], k, 65)


SHARES = (0.1, 0.3, 0.5, 0.65, 0.78, 0.86, 0.92, 0.98)
BESIDE = (-0.3, -0.15, -0.05, 0.0, 0.05, 0.1, 0.15, 0.3)
ANGLES = (0.5, 1.0, 1.3, 1.5, 1.6, 1.8, 2.0, 2.5)
AWAY = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.5)
SPEEDS = (0.01, 0.03, 0.07, 0.13, 0.22, 0.35, 0.5, 0.8)

TERM = Term(
    name="missing_tip_force",
    kind="body",
    law="F_X = a(X/L), F_Z = b(X/L) + d(Z/L), r(R/L) towards P, h(|V|) along V, moment m(Phi); tables, at the tip",
    source="fitted by `straw diagnose` where no hypothesis explains the runs",
    strengths=(
        "amount",
        *names("along_x_{}_n"),
        *names("along_z_{}_n"),
        *names("push_{}_n"),
        *names("aside_{}_n"),
        *names("turning_{}_n_m"),
        *names("pull_{}_n"),
    ),
    constants=(
        AMOUNT,
        *points("x_{}", SHARES, "along_x_{}_n", "N", -1.0, 0.2),
        *points("at_x_{}", SHARES, "along_z_{}_n", "N", -1.0, 0.2),
        *points("speed_{}_m_per_s", SPEEDS, "push_{}_n", "N", -1.0, 0.02),
        *points("z_{}", BESIDE, "aside_{}_n", "N", -1.0, 0.2),
        *points("phi_{}_rad", ANGLES, "turning_{}_n_m", "N m", -0.1, 4e-3),
        *points("far_{}", AWAY, "pull_{}_n", "N", -1.0, 0.2),
        Constant("post_x", "1", 1.0, -10.0, 10.0, "X of P over the unloaded length"),
        Constant("post_z", "1", -0.3, -10.0, 10.0, "Z of P over the unloaded length"),
    ),
    force=_force,
    rising=tuple(names(at) for at in ("x_{}", "at_x_{}", "speed_{}_m_per_s", "z_{}", "phi_{}_rad", "far_{}")),
    cause=False,
)
