"""Factors the Newton matrix of an implicit step from the tip to the base, at a cost linear in the number of cells.

W = M / hg^2 + B, with a block of B per frustum. The straw beyond a joint is an articulated body: its wrench on the
joint is linear in the joint's acceleration (Featherstone, Rigid Body Dynamics Algorithms, chapter 7). M itself,
singular in the full form, is neither formed nor inverted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants
from straw.model.kinematics import Chain

Floats = NDArray[np.float64]


class Articulated(NamedTuple):
    """Cell by cell; coordinates of a cell are zeta and phi of its frusta as they follow in q."""

    reach: Floats  # (cells, 2) from its base joint to the outer one
    answer: Floats  # (cells, moving, moving) accelerations per generalised force
    follow: Floats  # (cells, moving, 3) minus accelerations per acceleration of the base joint
    carry: Floats  # (cells, 3, moving) wrench on the base joint per acceleration
    moved: Floats  # (cells, moving, 3) motion of the outer joint per coordinate
    body: Floats  # (moving, 3) scratch: momentum of the body per coordinate
    momenta: Floats  # (cells, 3) scratch


@compiled
def articulated_for(c: Constants) -> Articulated:
    """Allocate for a straw."""
    n, k = c.cells, 2 * c.active
    return Articulated(
        np.zeros((n, 2)),
        np.zeros((n, k, k)),
        np.zeros((n, k, 3)),
        np.zeros((n, 3, k)),
        np.zeros((n, k, 3)),
        np.zeros((k, 3)),
        np.zeros((n, 3)),
    )


@allocates_nothing
def _invert2(G: Floats) -> None:
    over = 1 / (G[0, 0] * G[1, 1] - G[0, 1] * G[1, 0])
    G[0, 0], G[1, 1] = G[1, 1] * over, G[0, 0] * over
    G[0, 1] *= -over
    G[1, 0] *= -over


@allocates_nothing
def _invert(G: Floats, k: int) -> None:
    """Inverse in place by Gauss-Jordan elimination; the diagonal, of masses and stiffness, needs no pivots."""
    if k == 2:
        _invert2(G)
        return
    for i in range(k):
        over = 1 / G[i, i]
        G[i, i] = 1.0
        for j in range(k):
            G[i, j] *= over
        for row in range(k):
            if row != i:
                factor = G[row, i]
                G[row, i] = 0.0
                for j in range(k):
                    G[row, j] -= factor * G[i, j]


@allocates_nothing
def articulate(c: Constants, s: Chain, blocks: Floats, hg: float, out: Articulated) -> None:
    """Factor W for a straw in the chain's state; blocks (cells, 2, 2, 2) is B, frustum by frustum."""
    n, k, hg2 = c.cells, c.active, hg * hg
    # articulated inertia beyond the joint, 3 x 3: wrench per acceleration of the joint
    a00 = a11 = c.m_tip
    a22 = c.I_tip
    a01 = a02 = a10 = a12 = a20 = a21 = 0.0
    for i in range(n - 1, -1, -1):
        ux, uz = s.u[i, 0], s.u[i, 1]
        lx, lz = s.joint[i + 1, 0] - s.joint[i, 0], s.joint[i + 1, 1] - s.joint[i, 1]
        bx, bz = s.position[i, 0] - s.joint[i, 0], s.position[i, 1] - s.joint[i, 1]
        mass, inertia = s.mass[i], s.inertia[i]
        out.reach[i, 0], out.reach[i, 1] = lx, lz
        G, E, F = out.answer[i], out.follow[i], out.carry[i]
        for x in range(2 * k):
            frustum = x % k + 2 - k
            moved, body = out.moved[i, x], out.body[x]
            if x < k:
                moved[0], moved[1], moved[2] = ux, uz, 0.0
                own = frustum
            else:
                moved[0], moved[1], moved[2] = (lz, -lx, 1.0) if frustum == 0 else (0.0, 0.0, 1.0)
                own = 2 + frustum
            along, across = s.local[i, own, 0], s.local[i, own, 1]
            body[0], body[1] = mass * (along * ux + across * uz), mass * (along * uz - across * ux)
            body[2] = inertia * s.local[i, own, 2]
            # wrench of the outer part per this coordinate, then that on the base joint, with the body's own
            f0 = a00 * moved[0] + a01 * moved[1] + a02 * moved[2]
            f1 = a10 * moved[0] + a11 * moved[1] + a12 * moved[2]
            f2 = a20 * moved[0] + a21 * moved[1] + a22 * moved[2]
            F[0, x], F[1, x] = f0 + body[0], f1 + body[1]
            F[2, x] = f2 + lz * f0 - lx * f1 + body[2] + bz * body[0] - bx * body[1]
            for y in range(2 * k):
                # row y: projection of that wrench and of the body's own momentum on coordinate y
                frustum_y = y % k + 2 - k
                if y < k:
                    value, own_y = ux * f0 + uz * f1, frustum_y
                elif frustum_y == 0:
                    value, own_y = f2 + lz * f0 - lx * f1, 2
                else:
                    value, own_y = f2, 3
                g, h = s.local[i, own_y, 0], s.local[i, own_y, 1]
                value += (g * ux + h * uz) * body[0] + (g * uz - h * ux) * body[1] + s.local[i, own_y, 2] * body[2]
                if frustum_y == frustum:
                    value += hg2 * blocks[i, frustum, y // k, x // k]
                G[y, x] = value
        _invert(G, 2 * k)
        # per motion of the base joint: row E of each coordinate, and the outer part as one rigid body
        c02, c12, c22 = a02 + a00 * lz - a01 * lx, a12 + a10 * lz - a11 * lx, a22 + a20 * lz - a21 * lx
        b02, b12 = mass * bz, -mass * bx
        for y in range(2 * k):
            frustum_y = y % k + 2 - k
            own_y = frustum_y if y < k else 2 + frustum_y
            g, h = s.local[i, own_y, 0], s.local[i, own_y, 1]
            gx, gz, t = g * ux + h * uz, g * uz - h * ux, s.local[i, own_y, 2]
            p0, p1, p2 = out.moved[i, y, 0], out.moved[i, y, 1], out.moved[i, y, 2]
            out.body[y, 0] = p0 * a00 + p1 * a10 + p2 * a20 + gx * mass
            out.body[y, 1] = p0 * a01 + p1 * a11 + p2 * a21 + gz * mass
            out.body[y, 2] = p0 * c02 + p1 * c12 + p2 * c22 + gx * b02 + gz * b12 + t * inertia
        for y in range(2 * k):
            for z in range(3):
                total = 0.0
                for x in range(2 * k):
                    total += G[y, x] * out.body[x, z]
                E[y, z] = total
        a20, a21, a22 = a20 + lz * a00 - lx * a10, a21 + lz * a01 - lx * a11, c22 + lz * c02 - lx * c12
        a02, a12 = c02 + b02, c12 + b12
        a20, a21, a22 = a20 + mass * bz, a21 - mass * bx, a22 + inertia + bz * b02 - bx * b12
        a00, a11 = a00 + mass, a11 + mass
        for x in range(2 * k):
            a00 -= F[0, x] * E[x, 0]
            a01 -= F[0, x] * E[x, 1]
            a02 -= F[0, x] * E[x, 2]
            a10 -= F[1, x] * E[x, 0]
            a11 -= F[1, x] * E[x, 1]
            a12 -= F[1, x] * E[x, 2]
            a20 -= F[2, x] * E[x, 0]
            a21 -= F[2, x] * E[x, 1]
            a22 -= F[2, x] * E[x, 2]


@allocates_nothing
def solve(c: Constants, m: Articulated, force: Floats, hg: float, out: Floats) -> None:
    """Displacement W^-1 force, into out (coordinates,), which must not be ``force`` itself."""
    n, k, hg2 = c.cells, 2 * c.active, hg * hg
    b0 = b1 = b2 = 0.0
    for i in range(n - 1, -1, -1):
        G, F, moved = m.answer[i], m.carry[i], m.moved[i]
        lx, lz = m.reach[i, 0], m.reach[i, 1]
        t2 = b2 + lz * b0 - lx * b1
        s0, s1, s2 = b0, b1, t2
        for y in range(k):
            out[y * n + i] = 0.0
        for x in range(k):
            left = force[x * n + i] - moved[x, 0] * b0 - moved[x, 1] * b1 - moved[x, 2] * b2
            for y in range(k):
                out[y * n + i] += G[y, x] * left
        for x in range(k):
            d = out[x * n + i]
            s0 += F[0, x] * d
            s1 += F[1, x] * d
            s2 += F[2, x] * d
        b0, b1, b2 = s0, s1, s2
    y0 = y1 = y2 = 0.0
    for i in range(n):
        E, moved = m.follow[i], m.moved[i]
        n0, n1, n2 = y0 + y2 * m.reach[i, 1], y1 - y2 * m.reach[i, 0], y2
        for x in range(k):
            d = out[x * n + i] - E[x, 0] * y0 - E[x, 1] * y1 - E[x, 2] * y2
            n0 += moved[x, 0] * d
            n1 += moved[x, 1] * d
            n2 += moved[x, 2] * d
            out[x * n + i] = hg2 * d
        y0, y1, y2 = n0, n1, n2


@allocates_nothing
def momentum(c: Constants, s: Chain, m: Articulated, rate: Floats, out: Floats) -> None:
    """M(q) times a vector, into out (coordinates,): velocities from base to tip, then wrenches from tip to base."""
    n, k = c.cells, c.active
    y0 = y1 = y2 = 0.0
    for i in range(n):
        ux, uz = s.u[i, 0], s.u[i, 1]
        lx, lz = s.joint[i + 1, 0] - s.joint[i, 0], s.joint[i + 1, 1] - s.joint[i, 1]
        bx, bz = s.position[i, 0] - s.joint[i, 0], s.position[i, 1] - s.joint[i, 1]
        p0, p1, p2 = y0 + y2 * bz, y1 - y2 * bx, y2
        longer, turns = 0.0, 0.0
        for x in range(2 * k):
            frustum, d = x % k + 2 - k, rate[x * n + i]
            own = frustum if x < k else 2 + frustum
            along, across = s.local[i, own, 0] * d, s.local[i, own, 1] * d
            p0 += along * ux + across * uz
            p1 += along * uz - across * ux
            p2 += s.local[i, own, 2] * d
            if x < k:
                longer += d
            elif frustum == 0:
                y2 += d
            else:
                turns += d
        # the outer joint; the rotation by the cell's first angle is already in y2
        y0 += y2 * lz + longer * ux
        y1 += -y2 * lx + longer * uz
        y2 += turns
        m.momenta[i, 0], m.momenta[i, 1], m.momenta[i, 2] = s.mass[i] * p0, s.mass[i] * p1, s.inertia[i] * p2
    f0, f1, f2 = c.m_tip * y0, c.m_tip * y1, c.I_tip * y2
    for i in range(n - 1, -1, -1):
        ux, uz = s.u[i, 0], s.u[i, 1]
        lx, lz = s.joint[i + 1, 0] - s.joint[i, 0], s.joint[i + 1, 1] - s.joint[i, 1]
        bx, bz = s.position[i, 0] - s.joint[i, 0], s.position[i, 1] - s.joint[i, 1]
        g0, g1, g2 = m.momenta[i, 0], m.momenta[i, 1], m.momenta[i, 2]
        based = f2 + lz * f0 - lx * f1
        for x in range(2 * k):
            frustum = x % k + 2 - k
            own = frustum if x < k else 2 + frustum
            g, h = s.local[i, own, 0], s.local[i, own, 1]
            value = (g * ux + h * uz) * g0 + (g * uz - h * ux) * g1 + s.local[i, own, 2] * g2
            value += ux * f0 + uz * f1 if x < k else based if frustum == 0 else f2
            out[x * n + i] = value
        f0, f1, f2 = f0 + g0, f1 + g1, based + g2 + bz * g0 - bx * g1
