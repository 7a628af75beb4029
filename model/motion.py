"""Coordinates, rates and accelerations of all frusta, from the generalised coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants

Floats = NDArray[np.float64]


class Motion(NamedTuple):
    """All frusta's coordinates, rates and accelerations: arrays (cells, 2), SI."""

    zeta: Floats
    phi: Floats
    d_zeta: Floats
    d_phi: Floats
    dd_zeta: Floats
    dd_phi: Floats
    inside_pa: Floats  # (1,) pressure inside, and
    time_s: Floats  # (1,) time in the laboratory, on which laws of the frusta may depend


@compiled
def still_motion(c: Constants) -> Motion:
    """Allocate a motion: every frustum at its unloaded height, at rest."""
    n = c.cells
    return Motion(
        c.zeta0.copy(),
        np.zeros((n, 2)),
        np.zeros((n, 2)),
        np.zeros((n, 2)),
        np.zeros((n, 2)),
        np.zeros((n, 2)),
        np.zeros(1),
        np.full(1, c.start_s),
    )


@allocates_nothing
def spread(c: Constants, q: Floats, v: Floats, a: Floats, m: Motion) -> None:
    """Spread generalised coordinates over all frusta; rigid odd frusta stay at their unloaded shape.

    Order of q: zeta odd[N], zeta even[N], phi odd[N], phi even[N] in the full form; zeta even[N], phi even[N] in the
    truncated form.
    """
    n, k = c.cells, c.active
    for j in range(k):
        frustum = j + 2 - k
        for i in range(n):
            z, f = j * n + i, (k + j) * n + i
            m.zeta[i, frustum], m.d_zeta[i, frustum], m.dd_zeta[i, frustum] = q[z], v[z], a[z]
            m.phi[i, frustum], m.d_phi[i, frustum], m.dd_phi[i, frustum] = q[f], v[f], a[f]


@compiled
def motion_of(c: Constants, q: Floats, v: Floats, a: Floats) -> Motion:
    """The motion of all frusta that coordinates, rates and accelerations describe."""
    m = still_motion(c)
    spread(c, q, v, a, m)
    return m
