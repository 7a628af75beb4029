"""Load on the sealed end from outside (equation 5): forces F_X, F_Z and moment M_Y, zero unless given."""

from __future__ import annotations

from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.load import Load


@allocates_nothing
def add_tip_load(c: Constants, load: Load) -> None:
    """Add the forces along X and Z and the moment in the sense of growing Phi at the tip."""
    load.force[c.cells, 0] += c.F_X
    load.force[c.cells, 1] += c.F_Z
    load.torque[c.cells] += c.M_Y
