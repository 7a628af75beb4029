"""An unknown damping of the even frusta: tables over their speed and their height.

F = -g(|zeta'|) sign zeta' - d(zeta / |zeta_0|) zeta'
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.table import AMOUNT, empty, names, odd_table, points, table
from straw.model.term import Floats, Frustum, Term
from straw.model.terms.missing_force import HEIGHTS


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0 or f.zeta0 > 0:
        return 0.0, 0.0
    force = 0.0
    if not empty(k, 1):
        force -= odd_table(f.d_zeta, k, 1)
    if not empty(k, 17):
        force -= table(-f.zeta / f.zeta0, k, 17) * f.d_zeta
    return k[0] * force, 0.0


SPEEDS = (0.003, 0.01, 0.03, 0.06, 0.1, 0.17, 0.27, 0.4)

TERM = Term(
    name="missing_damping",
    kind="frustum",
    law="F = -g(|zeta'|) sign zeta' - d(zeta/|zeta_0|) zeta'; tables, even frusta only",
    source="fitted by `straw diagnose` where no hypothesis explains the runs",
    strengths=("amount", *names("force_{}_n"), *names("damping_{}_n_s_per_m")),
    constants=(
        AMOUNT,
        *points("speed_{}_m_per_s", SPEEDS, "force_{}_n", "N", -1.0, 2.0),
        *points("height_{}", HEIGHTS, "damping_{}_n_s_per_m", "N s/m", -10.0, 200.0),
    ),
    force=_force,
    rising=(names("speed_{}_m_per_s"), names("height_{}")),
    cause=False,
)
