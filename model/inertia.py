"""Kinetic energy (equation 3): mass matrix, and the forces of inertia with masses that vary with the shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.kinematics import Chain
from straw.model.load import Load

Floats = NDArray[np.float64]


@allocates_nothing
def add_inertia(c: Constants, s: Chain, load: Load) -> None:
    """Minus the left side of Lagrange's equations: -d/dt(dT/dv) + dT/dq.

    Masses and moments of inertia depend on q, hence dm/dt v and |v|^2/2 dm/dq beside m a (and the same for I).
    """
    for i in range(c.cells + 1):
        for axis in range(2):
            load.force[i, axis] -= s.mass[i] * s.acceleration[i, axis] + s.d_mass[i] * s.velocity[i, axis]
        load.torque[i] -= s.inertia[i] * s.d_spin[i] + s.d_inertia[i] * s.spin[i]
    for i in range(c.cells):
        half_speed2 = (s.velocity[i, 0] ** 2 + s.velocity[i, 1] ** 2) / 2
        half_spin2 = s.spin[i] ** 2 / 2
        for j in range(2 - c.active, 2):
            load.cell[i, j] += half_speed2 * c.rho * c.S + half_spin2 * s.inertia_by[i, j]
            load.cell[i, 2 + j] += half_spin2 * s.inertia_by[i, 2 + j]


@allocates_nothing
def mass_matrix(c: Constants, s: Chain, M: Floats) -> None:
    """M(q), into M (coordinates, coordinates).

    All bodies beyond cell j move with two inner coordinates i and j as one rigid body would, so only their summed
    mass, first and second moments are needed: composite bodies, cost N squared.
    """
    n, k = c.cells, c.active
    m, sx, sz = s.mass[n], s.mass[n] * s.position[n, 0], s.mass[n] * s.position[n, 1]
    second = s.inertia[n] + sx * s.position[n, 0] + sz * s.position[n, 1]
    # column b of cell j: cell j's own body moves by (along, across, spin), (ox, oz) in the world
    for j in range(n - 1, -1, -1):
        ux, uz = s.u[j, 0], s.u[j, 1]
        mj, Ij, x, z = s.mass[j], s.inertia[j], s.position[j, 0], s.position[j, 1]
        for b in range(2 * k):
            turning = b >= k
            frustum = b + 2 - 2 * k if turning else b + 2 - k
            col, own_b = b * n + j, frustum + 2 if turning else frustum
            along, across, spin = s.local[j, own_b, 0], s.local[j, own_b, 1], s.local[j, own_b, 2]
            # momentum of all bodies from j outwards for unit rate of this coordinate: linear (gx, gz), about origin h
            if turning:
                px, pz = s.joint[j + frustum, 0], s.joint[j + frustum, 1]
                gx, gz = sz - m * pz, -(sx - m * px)
                h = second - sx * px - sz * pz
            else:
                gx, gz = m * ux, m * uz
                h = ux * sz - uz * sx
            # within cell j
            for a in range(b + 1):
                if a >= k:
                    af = a + 2 - 2 * k
                    own_a = af + 2
                    value = h - (gx * s.joint[j + af, 1] - gz * s.joint[j + af, 0])
                else:
                    own_a = a + 2 - k
                    value = gx * ux + gz * uz
                value += mj * (along * s.local[j, own_a, 0] + across * s.local[j, own_a, 1])
                value += Ij * spin * s.local[j, own_a, 2]
                M[a * n + j, col] = value
                M[col, a * n + j] = value
            # cells nearer the base carry body j rigidly as well
            ox, oz = along * ux + across * uz, along * uz - across * ux
            gx += mj * ox
            gz += mj * oz
            h += mj * (ox * z - oz * x) + Ij * spin
            for i in range(j):
                for a in range(2 * k):
                    if a >= k:
                        af = a + 2 - 2 * k
                        value = h - (gx * s.joint[i + af, 1] - gz * s.joint[i + af, 0])
                    else:
                        value = gx * s.u[i, 0] + gz * s.u[i, 1]
                    M[a * n + i, col] = value
                    M[col, a * n + i] = value
        m += mj
        sx += mj * x
        sz += mj * z
        second += Ij + mj * (x**2 + z**2)
