"""An unknown force of the even frusta: tables over height, bending angle, cycles, the pressure inside and time.

F = f(zeta / |zeta_0|) (1 + c(cycle)) on zeta,  M = m(phi) (1 + c(cycle)) on phi,
walls with E (1 + e(cycle) + s(p) + a(t)).
"""

from __future__ import annotations

from straw.model.compiled import compiled
from straw.model.table import AMOUNT, empty, names, points, table, table_area
from straw.model.term import Floats, Frustum, Term
from straw.model.terms.elasticity import walls_energy, walls_force


@compiled
def _force(f: Frustum, k: Floats) -> tuple[float, float]:
    if k[0] == 0 or f.zeta0 > 0:
        return 0.0, 0.0
    force = moment = 0.0
    if not empty(k, 1):
        force += table(-f.zeta / f.zeta0, k, 1)
    if not empty(k, 17):
        moment += table(f.phi, k, 17)
    if not empty(k, 49):
        changed = 1.0 + table(f.cycle, k, 49)
        force *= changed
        moment *= changed
    if not (empty(k, 33) and empty(k, 65) and empty(k, 81)):
        share = table(f.cycle, k, 33) + table(f.pressure, k, 65) + table(f.time_s, k, 81)
        elastic, bending = walls_force(f)
        force += share * elastic
        moment += share * bending
    return k[0] * force, k[0] * moment


@compiled
def _energy(f: Frustum, k: Floats) -> float:
    if f.zeta0 > 0:
        return 0.0
    stored = f.zeta0 * table_area(-f.zeta / f.zeta0, k, 1) - table_area(f.phi, k, 17)
    changed = 1.0 + table(f.cycle, k, 49)
    share = table(f.cycle, k, 33) + table(f.pressure, k, 65) + table(f.time_s, k, 81)
    return float(k[0] * (stored * changed + share * walls_energy(f)))


#: Dense where the faces of a folded frustum nearly touch, and where a deployed one may meet a stop.
HEIGHTS = (-1.1, -1.0, -0.93, -0.83, -0.4, 0.6, 0.85, 1.1)
ANGLES = (-0.3, -0.15, -0.06, -0.02, 0.02, 0.06, 0.15, 0.3)
PRESSURES = (-30e3, -15e3, -5e3, 0.0, 5e3, 15e3, 25e3, 40e3)
CYCLES = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
TIMES_S = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)

TERM = Term(
    name="missing_force",
    kind="frustum",
    law="F = f(zeta/|zeta_0|), M = m(phi), both (1 + c(cycle)), E (1 + e(cycle) + s(p) + a(t)); tables, even frusta",
    source="fitted by `straw diagnose` where no hypothesis explains the runs",
    strengths=(
        "amount",
        *names("force_{}_n"),
        *names("moment_{}_n_m"),
        *names("stiffness_{}"),
        *names("change_{}"),
        *names("stiffer_{}"),
        *names("aged_{}"),
    ),
    constants=(
        AMOUNT,
        *points("height_{}", HEIGHTS, "force_{}_n", "N", -20.0, 2.0),
        *points("angle_{}_rad", ANGLES, "moment_{}_n_m", "N m", -0.1, 4e-3),
        *points("cycle_{}", CYCLES, "stiffness_{}", "1", -0.5, 0.2),
        *points("changed_{}", CYCLES, "change_{}", "1", -1.0, 0.5),
        *points("pressed_{}_pa", PRESSURES, "stiffer_{}", "1", -0.5, 0.2),
        *points("at_{}_s", TIMES_S, "aged_{}", "1", -0.5, 0.2),
    ),
    force=_force,
    energy=_energy,
    rising=tuple(
        names(at) for at in ("height_{}", "angle_{}_rad", "cycle_{}", "changed_{}", "pressed_{}_pa", "at_{}_s")
    ),
    cause=False,
)
