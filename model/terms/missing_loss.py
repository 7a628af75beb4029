"""Unknown losses in the inlet: of pressure over the flow of either direction or over cycles, of water over pressure."""

from __future__ import annotations

from straw.model.table import AMOUNT, names, points
from straw.model.term import Term
from straw.model.terms.missing_force import CYCLES, PRESSURES

FLOWS = (-4e-6, -2e-6, -0.7e-6, 0.0, 0.5e-6, 1.2e-6, 2.5e-6, 5e-6)

TERM = Term(
    name="missing_loss",
    kind="flow",
    law="dp = l(Q), Q = V' + g(p_in), and equation 2 with K (1 + k(cycle)); tables",
    source="fitted by `straw diagnose` where no hypothesis explains the runs",
    strengths=("amount", *names("loss_{}_pa"), *names("leak_{}_m3_per_s"), *names("share_{}")),
    constants=(
        AMOUNT,
        *points("flow_{}_m3_per_s", FLOWS, "loss_{}_pa", "Pa", -30e3, 4e3),
        *points("pressure_{}_pa", PRESSURES, "leak_{}_m3_per_s", "m^3/s", -4e-6, 0.4e-6),
        *points("cycle_{}", CYCLES, "share_{}", "1", -0.5, 0.2),
    ),
    rising=(names("flow_{}_m3_per_s"), names("pressure_{}_pa"), names("cycle_{}")),
    cause=False,
)
