"""Gravity on the fluid of each cell and on the sealing (equation 5): -m g along Z at each centre of mass."""

from __future__ import annotations

from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.kinematics import Chain
from straw.model.load import Load


@allocates_nothing
def add_gravity(c: Constants, s: Chain, load: Load) -> None:
    """Add -m g to each body's vertical force."""
    for i in range(c.cells + 1):
        load.force[i, 1] -= s.mass[i] * c.g
