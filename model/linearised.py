"""The straw's equations linearised exactly, cell by cell, in the cell's coordinates and the motion of its base.

The inner part of the straw acts on a cell only through the motion of its base joint, the outer part only through the
wrench on its outer joint: Featherstone's recursions, with the derivatives of Carpentier and Mansard 2018. Changes
of velocity, acceleration and force are taken in axes that turn with the straw (world's directions, the turn taken out),
and gravity is an acceleration of the base, so that a turned straw is the same straw.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.body import I0, I1, L0, L1, L2, MASS, T0, T1, T2, X0, X1, X2, Body, second, shape_of
from straw.model.compiled import allocates_nothing, fused
from straw.model.constants import Constants
from straw.model.links import (
    ANGLE,
    AX,
    AZ,
    CHANGES,
    D_SPIN,
    JOINT,
    JOINT_IN_WORLD,
    SPIN,
    VX,
    VZ,
    Links,
    Loads,
    X,
    Z,
    force_on,
    loads_of,
)
from straw.model.motion import Motion

Floats = NDArray[np.float64]


@fused
def _joint_changes(b: Body, p: Loads, ux: float, uz: float, spin: float, dims: int, g: Floats) -> None:
    """Changes of the body with the joint's motion, one row per column of the links; see `_rows` for a row's entries."""
    for d in range(dims):
        for x in range(CHANGES):
            g[d, x] = 0.0
    g[VX, 0], g[VX, 1], g[VZ, 0], g[VZ, 1] = ux, uz, uz, -ux
    g[VX, 3], g[VX, 4], g[VZ, 3], g[VZ, 4] = -b.mass1 * ux, -b.mass1 * uz, -b.mass1 * uz, b.mass1 * ux
    g[AX, 3], g[AX, 4], g[AZ, 3], g[AZ, 4] = -b.mass * ux, -b.mass * uz, -b.mass * uz, b.mass * ux
    g[SPIN, 0], g[SPIN, 1], g[SPIN, 2] = -b.x0, b.l0, 1.0
    g[SPIN, 3] = 2 * b.mass * (b.l0 * spin + b.x1) + b.mass1 * b.x0
    g[SPIN, 4] = 2 * b.mass * (b.x0 * spin - b.l1) - b.mass1 * b.l0
    g[SPIN, 5] = -b.inertia1
    g[D_SPIN, 3], g[D_SPIN, 4], g[D_SPIN, 5] = b.mass * b.x0, -b.mass * b.l0, -b.inertia


@fused
def _own_changes(b: Body, p: Loads, by: Floats, spin: float, d_spin: float, q: Floats, v: Floats, a: Floats) -> None:
    """Changes of the body with a coordinate's displacement, rate and acceleration, as in `_joint_changes`."""
    l0, l1, l2, x0, x1, x2, t0, t1, t2 = by[L0], by[L1], by[L2], by[X0], by[X1], by[X2], by[T0], by[T1], by[T2]
    mass, inertia = by[MASS], by[I0]
    q[0], q[1], q[2] = l1 - x0 * spin, l0 * spin + x1, t1
    d_au = l2 - l0 * spin**2 - 2 * x1 * spin - x0 * d_spin
    d_aw = 2 * l1 * spin + l0 * d_spin + x2 - x0 * spin**2
    q[3] = -(mass * p.a_u + b.mass * d_au + b.mass1 * q[0])
    q[4] = -(mass * p.a_w + b.mass * d_aw + b.mass1 * q[1])
    q[5] = -(inertia * p.d_spin + b.inertia * t2 + by[I1] * p.spin + b.inertia1 * t1)
    q[6], q[7], q[8] = l0, x0, mass
    v[0], v[1], v[2] = l0, x0, t0
    v[3] = -(2 * b.mass * (l1 - x0 * spin) + mass * p.v_u + b.mass1 * l0)
    v[4] = -(2 * b.mass * (l0 * spin + x1) + mass * p.v_w + b.mass1 * x0)
    v[5] = -(2 * b.inertia * t1 + inertia * p.spin + b.inertia1 * t0)
    a[0] = a[1] = a[2] = 0.0
    a[3], a[4], a[5] = -b.mass * l0, -b.mass * x0, -b.inertia * t0
    for x in range(6, CHANGES):
        v[x] = a[x] = 0.0


@fused
def _push_changes(b: Body, p: Loads, ux: float, uz: float, k: Floats, pushed: Floats, slots: int, g: Floats) -> None:
    """Add the changes of the world's forces on a body with its place and motion, in axes that turn with the straw."""
    va, vb = p.v_u * ux + p.v_w * uz, p.v_u * uz - p.v_w * ux
    for column in range(JOINT_IN_WORLD + slots * 3):
        turned, px, pz = 1.0 if column == ANGLE else 0.0, 1.0 if column == X else 0.0, 1.0 if column == Z else 0.0
        r = g[column]
        px += r[6] * ux + r[7] * uz + (b.l0 * uz - b.x0 * ux) * turned
        pz += r[6] * uz - r[7] * ux - (b.l0 * ux + b.x0 * uz) * turned
        vx, vz = r[0] * ux + r[1] * uz + vb * turned, r[0] * uz - r[1] * ux - va * turned
        fx = k[0, 0] * px + k[0, 1] * pz + k[0, 2] * vx + k[0, 3] * vz + k[0, 4] * r[8] + k[0, 5] * r[2]
        fz = k[1, 0] * px + k[1, 1] * pz + k[1, 2] * vx + k[1, 3] * vz + k[1, 4] * r[8] + k[1, 5] * r[2]
        fx -= pushed[1] * turned
        fz += pushed[0] * turned
        r[5] += k[2, 0] * px + k[2, 1] * pz + k[2, 2] * vx + k[2, 3] * vz + k[2, 4] * r[8] + k[2, 5] * r[2]
        r[3] += fx * ux + fz * uz
        r[4] += fx * uz - fz * ux


@fused
def _rows(b: Body, p: Loads, ux: float, uz: float, s: Links, i: int, columns: int, moving: int) -> None:
    """A cell's own rows from what each column changes: the body's velocity along and across, its spin, its force along
    and across, its torque, its place along and across, its mass."""
    own = s.own[i]
    for column in range(columns):
        r = s.changes[column]
        own[0, column], own[1, column] = r[3] * ux + r[4] * uz, r[3] * uz - r[4] * ux
        own[2, column] = r[5] + r[6] * p.f_w + b.l0 * r[4] - r[7] * p.f_u - b.x0 * r[3]
        lively, turning = p.v_u * r[0] + p.v_w * r[1], p.spin * r[2]
        for row in range(moving):
            by = s.by[s.slots[row]]
            own[3 + row, column] = (
                (by[L0] * r[3] + by[X0] * r[4] + by[T0] * r[5]) + by[MASS] * lively + by[I0] * turning
            )


@fused
def _outer_joint(
    m: Motion, i: int, ux: float, uz: float, spin: float, d_spin: float, s: Links, dims: int, slots: int
) -> None:
    """Motion of the outer joint as a function of the base joint's and the cell's, before the cell's first angle."""
    base, tip, there = s.joint[i], s.joint[i + 1], s.next[i]
    length, d_length = m.zeta[i, 0] + m.zeta[i, 1], m.d_zeta[i, 0] + m.d_zeta[i, 1]
    s.length[i] = length
    a_u = m.dd_zeta[i, 0] + m.dd_zeta[i, 1] - length * spin**2
    a_w = 2 * d_length * spin + length * d_spin
    tip[VX] = base[VX] + d_length * ux + length * spin * uz
    tip[VZ] = base[VZ] + d_length * uz - length * spin * ux
    tip[AX], tip[AZ] = base[AX] + a_u * ux + a_w * uz, base[AZ] + a_u * uz - a_w * ux
    tip[X], tip[Z] = base[X] + length * ux, base[Z] + length * uz
    tip[SPIN], tip[D_SPIN] = spin + m.d_phi[i, 1], d_spin + m.dd_phi[i, 1]
    tip[ANGLE] = base[ANGLE] + m.phi[i, 0] + m.phi[i, 1]
    for row in range(dims):
        for column in range(dims + 3 * slots):
            there[row, column] = 0.0
        there[row, row] = 1.0
    there[VX, SPIN], there[VZ, SPIN] = length * uz, -length * ux
    there[AX, SPIN] = -2 * length * spin * ux + 2 * d_length * uz
    there[AZ, SPIN] = -2 * length * spin * uz - 2 * d_length * ux
    there[AX, D_SPIN], there[AZ, D_SPIN] = length * uz, -length * ux
    in_world = dims == JOINT_IN_WORLD
    if in_world:
        there[X, ANGLE], there[Z, ANGLE] = length * uz, -length * ux
    for x in range(slots):
        slot, q, v, a = s.slots[x], dims + x, dims + slots + x, dims + 2 * slots + x
        if slot < 2:
            there[VX, q], there[VZ, q] = spin * uz, -spin * ux
            there[AX, q], there[AZ, q] = -(spin**2) * ux + d_spin * uz, -(spin**2) * uz - d_spin * ux
            there[VX, v], there[VZ, v], there[AX, a], there[AZ, a] = ux, uz, ux, uz
            there[AX, v], there[AZ, v] = 2 * spin * uz, -2 * spin * ux
            if in_world:
                there[X, q], there[Z, q] = ux, uz
        elif slot == 3:  # turns the outer part about the outer joint
            there[VX, q], there[VZ, q], there[AX, q], there[AZ, q] = -tip[VZ], tip[VX], -tip[AZ], tip[AX]
            there[SPIN, v] = there[D_SPIN, a] = 1.0
            if in_world:
                there[ANGLE, q] = 1.0


@fused
def _turn_base(base: Floats, dims: int, slots: int, matrix: Floats) -> None:
    """Add the turn of the cell about its base joint to the columns of phi_1, the third slot."""
    q, v, a = dims + 2, dims + slots + 2, dims + 2 * slots + 2
    for row in range(len(matrix)):
        r = matrix[row]
        r[q] += base[VX] * r[VZ] - base[VZ] * r[VX] + base[AX] * r[AZ] - base[AZ] * r[AX]
        if dims == JOINT_IN_WORLD:
            r[q] += r[ANGLE]
        r[v] += r[SPIN]
        r[a] += r[D_SPIN]


@allocates_nothing
def linearise(c: Constants, m: Motion, frusta: Floats, law: Floats, pushed: Floats, s: Links) -> None:
    """Fill the links for a motion.

    ``frusta`` (cells, 2, 2, 4): derivatives of each frustum's force and moment by its zeta, phi and their rates.
    ``law`` (cells + 1, LAW_OUT, LAW_IN): of the world's force and torque on each body by its place, velocity, mass,
    spin and the tip's angle, and ``pushed`` (cells + 1, LAW_OUT) these themselves; not looked at unless the world's
    axes matter.
    """
    dims, slots, moving = s.next.shape[1], len(s.slots), 2 * c.active
    if dims == JOINT and slots == 2 and moving == 2:  # sizes known at compile time: most straws, in half the time
        _linearise(c, m, frusta, law, pushed, s, JOINT, 2, 2)
    elif dims == JOINT and slots == 3 and moving == 2:
        _linearise(c, m, frusta, law, pushed, s, JOINT, 3, 2)
    else:
        _linearise(c, m, frusta, law, pushed, s, dims, slots, moving)


@fused
def _linearise(
    c: Constants, m: Motion, frusta: Floats, law: Floats, pushed: Floats, s: Links, dims: int, slots: int, moving: int
) -> None:
    columns = dims + 3 * slots
    for d in range(JOINT_IN_WORLD):
        s.joint[0, d] = 0.0
    s.joint[0, AZ], s.joint[0, ANGLE] = c.g, c.phi_0
    for i in range(c.cells):
        base, own = s.joint[i], s.own[i]
        angle, spin, d_spin = base[ANGLE] + m.phi[i, 0], base[SPIN] + m.d_phi[i, 0], base[D_SPIN] + m.dd_phi[i, 0]
        ux, uz = math.sin(angle), math.cos(angle)
        s.axis[i, 0], s.axis[i, 1] = ux, uz
        b = shape_of(c, m, i, s.slots, s.by)
        p = loads_of(b, base, ux, uz, spin, d_spin, pushed[i], dims == JOINT_IN_WORLD)
        second(c, m, i, b, s.slots, s.by, p.f_u, p.f_w, p.torque, p.spin**2, s.second)
        s.wrench[i, 0], s.wrench[i, 1] = p.f_u * ux + p.f_w * uz, p.f_u * uz - p.f_w * ux
        s.wrench[i, 2] = p.torque + b.l0 * p.f_w - b.x0 * p.f_u
        for x in range(slots):
            s.force[i, x] = force_on(s.by[s.slots[x]], p)
            if s.slots[x] == 2:  # phi_1 turns all of the cell
                s.force[i, x] += s.wrench[i, 2]
        g = s.changes
        _joint_changes(b, p, ux, uz, spin, dims, g)
        for x in range(slots):
            at = dims + x
            _own_changes(b, p, s.by[s.slots[x]], spin, d_spin, g[at], g[at + slots], g[at + 2 * slots])
        if dims == JOINT_IN_WORLD:
            _push_changes(b, p, ux, uz, law[i], pushed[i], slots, g)
        _rows(b, p, ux, uz, s, i, columns, moving)
        for row in range(moving):
            its = s.slots[row]
            for x in range(slots):
                slot, f = s.slots[x], s.slots[x] % 2
                own[3 + row, dims + x] += s.second[its, slot]
                if its % 2 == f:
                    own[3 + row, dims + x] += frusta[i, f, its // 2, slot // 2]
                    own[3 + row, dims + slots + x] += frusta[i, f, its // 2, 2 + slot // 2]
        _outer_joint(m, i, ux, uz, spin, d_spin, s, dims, slots)
        if c.active == 2:
            for column in range(columns):
                own[5, column] += own[2, column]  # the force on phi_1 is the moment about the base joint
            _turn_base(base, dims, slots, own)
            _turn_base(base, dims, slots, s.next[i])
    tip = s.joint[c.cells]
    s.axis[c.cells, 0], s.axis[c.cells, 1] = math.sin(tip[ANGLE]), math.cos(tip[ANGLE])
