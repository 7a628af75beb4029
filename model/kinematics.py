"""Where every cell is and how it moves: the chain of frames and the fluid's centre of mass in each cell (section 2.1).

Directions in the (X, Z) plane: u = (sin Phi, cos Phi) along a cell's axis, w = du/dPhi = (cos Phi, -sin Phi).
R(x, z) = (z, -x) turns u into w, so that a rotation about P moves a point C by R(C - P).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.constants import Constants
from straw.model.motion import Motion

Floats = NDArray[np.float64]


class Chain(NamedTuple):
    """Frames and bodies along the straw. Joint n is the base of cell n; the last joint is the tip.

    Bodies 0 .. cells - 1 are the fluid of each cell, body ``cells`` is the sealing at the tip. ``local`` holds the
    derivatives of a body's position along u, along w, and of its angle, by its own cell's (zeta_1, zeta_2, phi_1,
    phi_2); the rotation of the whole cell by phi_1 is included. The truncated form has no use for zeta_1's and phi_1's.
    """

    joint: Floats  # (cells + 1, 2) position, m
    u: Floats  # (cells, 2) axis of the cell's middle surface
    tip_axis: Floats  # (2,)
    tip_angle: Floats  # (1,)
    mass: Floats  # (cells + 1,)
    inertia: Floats  # (cells + 1,)
    d_mass: Floats  # (cells + 1,) rate
    d_inertia: Floats  # (cells + 1,) rate
    inertia_by: Floats  # (cells, 4) derivative of inertia by the cell's own coordinates
    position: Floats  # (cells + 1, 2)
    velocity: Floats  # (cells + 1, 2)
    acceleration: Floats  # (cells + 1, 2)
    spin: Floats  # (cells + 1,) angular rate
    d_spin: Floats  # (cells + 1,) angular acceleration
    local: Floats  # (cells, 4, 3)


@compiled
def empty_chain(cells: int) -> Chain:
    """Allocate a chain; joint 0 remains the origin."""
    n = cells
    return Chain(
        np.zeros((n + 1, 2)),
        np.empty((n, 2)),
        np.empty(2),
        np.empty(1),
        np.empty(n + 1),
        np.empty(n + 1),
        np.zeros(n + 1),
        np.zeros(n + 1),
        np.empty((n, 4)),
        np.empty((n + 1, 2)),
        np.empty((n + 1, 2)),
        np.empty((n + 1, 2)),
        np.empty(n + 1),
        np.empty(n + 1),
        np.empty((n, 4, 3)),
    )


@compiled
def chain_of(c: Constants, m: Motion) -> Chain:
    """The chain a motion makes."""
    s = empty_chain(c.cells)
    place(c, m, s)
    return s


@allocates_nothing
def place(c: Constants, m: Motion, s: Chain) -> None:
    """Fill in positions, velocities, accelerations and inertias of all bodies for the given motion."""
    n, k = c.cells, c.active
    r_i, r_o = c.r_i, c.r_o
    shape = 8 * (r_o**2 + r_i**2 + r_o * r_i)
    # x_bar = -x1 (phi_1 + phi_2) / L;  z_bar = z1 (zeta_2 - zeta_1) + z2 (phi_2^2 - phi_1^2) / L, with L the length;
    # the paper's (zeta_2^2 - zeta_1^2) / L is divided out.
    x1 = r_o * r_i / 4
    z1 = 2 * (r_o**2 + 3 * r_i**2 + 2 * r_o * r_i) / shape
    z2 = r_o * r_i**2 * (r_o + 2 * r_i) / shape
    i1 = math.pi * c.rho * (r_o**2 + 6 * r_i**2 + 3 * r_o * r_i) / 30
    i2 = math.pi * c.rho * r_i**2 * (r_o**2 + r_i**2 + 3 * r_o * r_i) / 20
    i3 = math.pi * c.rho * (r_o**5 - r_i**5) / (20 * (r_o - r_i))

    angle, spin, d_spin = c.phi_0, 0.0, 0.0
    vx = vz = ax = az = 0.0
    for i in range(n):
        zeta_1, zeta_2, phi_1, phi_2 = m.zeta[i, 0], m.zeta[i, 1], m.phi[i, 0], m.phi[i, 1]
        dz1, dz2, df1, df2 = m.d_zeta[i, 0], m.d_zeta[i, 1], m.d_phi[i, 0], m.d_phi[i, 1]
        angle += phi_1
        spin += df1
        d_spin += m.dd_phi[i, 0]
        ux, uz = math.sin(angle), math.cos(angle)
        wx, wz = uz, -ux

        length, d_length = zeta_1 + zeta_2, dz1 + dz2
        dd_length = m.dd_zeta[i, 0] + m.dd_zeta[i, 1]
        over, rate = 1 / length, d_length / length
        sum_phi, d_sum_phi = phi_1 + phi_2, df1 + df2
        dd_sum_phi = m.dd_phi[i, 0] + m.dd_phi[i, 1]
        dif = phi_2**2 - phi_1**2
        d_dif = 2 * (phi_2 * df2 - phi_1 * df1)
        dd_dif = 2 * (df2**2 - df1**2 + phi_2 * m.dd_phi[i, 1] - phi_1 * m.dd_phi[i, 0])

        # centre of mass in the cell, its rates, and its derivatives by the cell's own coordinates
        x = -x1 * sum_phi * over
        z = z1 * (zeta_2 - zeta_1) + z2 * dif * over
        dx = -x1 * (d_sum_phi - sum_phi * rate) * over
        dz = z1 * (dz2 - dz1) + z2 * (d_dif - dif * rate) * over
        curl = 2 * rate**2 - dd_length * over
        ddx = -x1 * (dd_sum_phi - 2 * d_sum_phi * rate + sum_phi * curl) * over
        ddz = z1 * (m.dd_zeta[i, 1] - m.dd_zeta[i, 0]) + z2 * (dd_dif - 2 * d_dif * rate + dif * curl) * over
        x_by_zeta, x_by_phi = x1 * sum_phi * over**2, -x1 * over
        z_by_zeta = -z2 * dif * over**2

        r2 = x**2 + z**2
        over_r2 = 1 / r2
        tilt_rate = (x * dz - z * dx) * over_r2
        tilt_accel = (x * ddz - z * ddx - 2 * tilt_rate * (x * dx + z * dz)) * over_r2

        along = zeta_1 + z
        mass = c.rho * c.S * length
        d_inertia = 0.0
        for j in range(2 - k, 2):
            sign = 2.0 * j - 1
            zeta_j, phi_j = m.zeta[i, j], m.phi[i, j]
            z_by = sign * z1 + z_by_zeta
            by_zeta = 3 * i1 * zeta_j**2 + i2 * phi_j**2 + i3 - c.rho * c.S * r2 - 2 * mass * (x * x_by_zeta + z * z_by)
            s.local[i, j, 0], s.local[i, j, 1] = z_by + (1 - j), x_by_zeta
            s.local[i, j, 2] = (x * z_by - z * x_by_zeta) * over_r2
            z_by = sign * 2 * z2 * phi_j * over
            by_phi = 2 * i2 * zeta_j * phi_j - 2 * mass * (x * x_by_phi + z * z_by)
            s.local[i, 2 + j, 0], s.local[i, 2 + j, 1] = z_by, x_by_phi
            s.local[i, 2 + j, 2] = (x * z_by - z * x_by_phi) * over_r2
            s.inertia_by[i, j], s.inertia_by[i, 2 + j] = by_zeta, by_phi
            d_inertia += by_zeta * m.d_zeta[i, j] + by_phi * m.d_phi[i, j]
        if k == 2:  # phi_1 also turns the whole cell about its base
            s.local[i, 2, 0] -= x
            s.local[i, 2, 1] += along
            s.local[i, 2, 2] += 1

        d_along, dd_along = dz1 + dz, m.dd_zeta[i, 0] + ddz
        px, pz = s.joint[i, 0], s.joint[i, 1]
        s.u[i, 0], s.u[i, 1] = ux, uz
        s.mass[i], s.d_mass[i] = mass, c.rho * c.S * d_length
        s.inertia[i] = (
            i1 * (zeta_1**3 + zeta_2**3) + i2 * (zeta_1 * phi_1**2 + zeta_2 * phi_2**2) + i3 * length - mass * r2
        )
        s.d_inertia[i] = d_inertia
        s.position[i, 0] = px + along * ux + x * wx
        s.position[i, 1] = pz + along * uz + x * wz
        v_u, v_w = d_along - x * spin, along * spin + dx
        s.velocity[i, 0] = vx + v_u * ux + v_w * wx
        s.velocity[i, 1] = vz + v_u * uz + v_w * wz
        a_u = dd_along - along * spin**2 - 2 * dx * spin - x * d_spin
        a_w = 2 * d_along * spin + along * d_spin + ddx - x * spin**2
        s.acceleration[i, 0] = ax + a_u * ux + a_w * wx
        s.acceleration[i, 1] = az + a_u * uz + a_w * wz
        s.spin[i] = spin + tilt_rate
        s.d_spin[i] = d_spin + tilt_accel

        s.joint[i + 1, 0], s.joint[i + 1, 1] = px + length * ux, pz + length * uz
        vx += d_length * ux + length * spin * wx
        vz += d_length * uz + length * spin * wz
        a_u, a_w = dd_length - length * spin**2, 2 * d_length * spin + length * d_spin
        ax += a_u * ux + a_w * wx
        az += a_u * uz + a_w * wz
        angle += phi_2
        spin += df2
        d_spin += m.dd_phi[i, 1]

    s.tip_axis[0], s.tip_axis[1] = math.sin(angle), math.cos(angle)
    s.tip_angle[0] = angle
    s.position[n, 0], s.position[n, 1] = s.joint[n, 0], s.joint[n, 1]
    s.velocity[n, 0], s.velocity[n, 1] = vx, vz
    s.acceleration[n, 0], s.acceleration[n, 1] = ax, az
    s.spin[n], s.d_spin[n] = spin, d_spin
    s.mass[n], s.inertia[n] = c.m_tip, c.I_tip


@exposed
def tip_pose(c: Constants, q: Floats) -> tuple[float, float, float]:
    """Tip X (m), Z (m) and Phi (rad): the face of the last cell."""
    n, k = c.cells, c.active
    x, z, angle = 0.0, 0.0, c.phi_0
    for i in range(n):
        zeta_1, phi_1 = c.zeta0[i, 0], 0.0
        if k == 2:
            zeta_1, phi_1 = q[i], q[2 * n + i]
        length = zeta_1 + q[(k - 1) * n + i]
        angle += phi_1
        x += length * math.sin(angle)
        z += length * math.cos(angle)
        angle += q[(2 * k - 1) * n + i]
    return x, z, angle
