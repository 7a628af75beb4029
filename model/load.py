"""Load: the sum of the terms' forces, and its projection on the generalised coordinates (virtual work, equation 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.constants import Constants
from straw.model.kinematics import Chain

Floats = NDArray[np.float64]


class Load(NamedTuple):
    """Forces on one state of the straw; every term adds to them."""

    cell: Floats  # (cells, 4) generalised force on each cell's zeta_1, zeta_2 (N) and phi_1, phi_2 (N m)
    force: Floats  # (cells + 1, 2) force at each body's centre of mass, N; the last body is the tip
    torque: Floats  # (cells + 1,) torque on each body, in the sense of growing Phi, N m


@compiled
def no_load(cells: int) -> Load:
    """A load of zero."""
    return Load(np.zeros((cells, 4)), np.zeros((cells + 1, 2)), np.zeros(cells + 1))


@allocates_nothing
def unload(load: Load) -> None:
    """Take all loads off."""
    load.cell[:] = 0.0
    load.force[:] = 0.0
    load.torque[:] = 0.0


@exposed
def project(c: Constants, s: Chain, load: Load, out: Floats) -> None:
    """Generalised force that does the same virtual work as the load, into out (coordinates,).

    Runs from the tip to the base and carries the sum of the outer bodies' forces, torques and moments about the
    origin, so the cost grows with N, not with N squared.
    """
    n, k = c.cells, c.active
    fx, fz = load.force[n, 0], load.force[n, 1]
    moment = load.torque[n] + fx * s.position[n, 1] - fz * s.position[n, 0]  # F . R(C)
    for i in range(n - 1, -1, -1):
        ux, uz = s.u[i, 0], s.u[i, 1]
        bx, bz, torque = load.force[i, 0], load.force[i, 1], load.torque[i]
        along = bx * ux + bz * uz
        across = bx * uz - bz * ux
        stretch = fx * ux + fz * uz
        for j in range(k):
            f = j + 2 - k
            stretched = s.local[i, f, 0] * along + s.local[i, f, 1] * across + s.local[i, f, 2] * torque
            out[j * n + i] = load.cell[i, f] + stretch + stretched
            turn = moment - (fx * s.joint[i + f, 1] - fz * s.joint[i + f, 0])
            bent = s.local[i, 2 + f, 0] * along + s.local[i, 2 + f, 1] * across + s.local[i, 2 + f, 2] * torque
            out[(k + j) * n + i] = load.cell[i, 2 + f] + turn + bent
        fx += bx
        fz += bz
        moment += torque + bx * s.position[i, 1] - bz * s.position[i, 0]
