"""A cell's fluid as a body: place, tilt, mass and inertia, and their derivatives by the cell's coordinates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import fused
from straw.model.constants import Constants
from straw.model.motion import Motion

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


class Body(NamedTuple):
    """A cell's fluid in its cell's axes: length, place along and across, tilt; digits count time derivatives."""

    l0: float
    l1: float
    l2: float
    x0: float
    x1: float
    x2: float
    tilt1: float
    tilt2: float
    mass: float
    mass1: float
    inertia: float
    inertia1: float


#: Columns of the derivatives by a coordinate: of along, across (and their rates), tilt, mass, inertia.
L0, L1, L2, X0, X1, X2, T0, T1, T2, MASS, I0, I1 = range(12)


@fused
def _times(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    """Product of two quantities and its first two time derivatives."""
    return (a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2])


@fused
def _inverse(a: tuple[float, float, float]) -> tuple[float, float, float]:
    """One over a quantity and its first two time derivatives."""
    over = 1 / a[0]
    rate = -a[1] * over
    return over, rate * over, (2 * rate**2 - a[2] * over) * over


@fused
def _factors(c: Constants) -> tuple[float, float, float, float, float, float]:
    """Of the place (across; along by heights, by angles) and of the inertia (three) of a cell's fluid, see `place`."""
    r_i, r_o = c.r_i, c.r_o
    size = 8 * (r_o**2 + r_i**2 + r_o * r_i)
    return (
        r_o * r_i / 4,
        2 * (r_o**2 + 3 * r_i**2 + 2 * r_o * r_i) / size,
        r_o * r_i**2 * (r_o + 2 * r_i) / size,
        math.pi * c.rho * (r_o**2 + 6 * r_i**2 + 3 * r_o * r_i) / 30,
        math.pi * c.rho * r_i**2 * (r_o**2 + r_i**2 + 3 * r_o * r_i) / 20,
        math.pi * c.rho * (r_o**5 - r_i**5) / (20 * (r_o - r_i)),
    )


@fused
def shape_of(c: Constants, m: Motion, i: int, slots: Indices, by_slot: Floats) -> Body:
    """The body of cell i, and the derivatives of its place, tilt, mass and inertia by the coordinates, ``by_slot``."""
    cx, z1, z2, i1, i2, i3 = _factors(c)
    za, zb, fa, fb = m.zeta[i, 0], m.zeta[i, 1], m.phi[i, 0], m.phi[i, 1]
    za1, zb1, fa1, fb1 = m.d_zeta[i, 0], m.d_zeta[i, 1], m.d_phi[i, 0], m.d_phi[i, 1]
    za2, zb2, fa2, fb2 = m.dd_zeta[i, 0], m.dd_zeta[i, 1], m.dd_phi[i, 0], m.dd_phi[i, 1]
    length = za + zb, za1 + zb1, za2 + zb2
    o = _inverse(length)
    o2 = _times(o, o)
    turn = fa + fb, fa1 + fb1, fa2 + fb2
    dif = (fb**2 - fa**2, 2 * (fb * fb1 - fa * fa1), 2 * (fb1**2 - fa1**2 + fb * fb2 - fa * fa2))
    so, do, so2, do2 = _times(turn, o), _times(dif, o), _times(turn, o2), _times(dif, o2)
    x = -cx * so[0], -cx * so[1], -cx * so[2]
    z = (z1 * (zb - za) + z2 * do[0], z1 * (zb1 - za1) + z2 * do[1], z1 * (zb2 - za2) + z2 * do[2])
    xx, zz = _times(x, x), _times(z, z)
    r2 = xx[0] + zz[0], xx[1] + zz[1], xx[2] + zz[2]
    over = _inverse(r2)
    mass, mass1 = c.rho * c.S * length[0], c.rho * c.S * length[1]
    tilt1 = (x[0] * z[1] - z[0] * x[1]) * over[0]
    tilt2 = (x[0] * z[2] - z[0] * x[2] - 2 * tilt1 * (x[0] * x[1] + z[0] * z[1])) * over[0]
    inertia = i1 * (za**3 + zb**3) + i2 * (za * fa**2 + zb * fb**2) + i3 * length[0] - mass * r2[0]
    inertia1 = 0.0
    for at in range(len(slots)):
        slot = slots[at]
        j, sign = slot % 2, 2.0 * (slot % 2) - 1
        zeta, zeta_1 = m.zeta[i, j], m.d_zeta[i, j]
        phi = m.phi[i, j], m.d_phi[i, j], m.dd_phi[i, j]
        if slot < 2:
            xs = cx * so2[0], cx * so2[1], cx * so2[2]
            zs = sign * z1 - z2 * do2[0], -z2 * do2[1], -z2 * do2[2]
            mass_by = c.rho * c.S
            own, own1 = 3 * i1 * zeta**2 + i2 * phi[0] ** 2 + i3, 6 * i1 * zeta * zeta_1 + 2 * i2 * phi[0] * phi[1]
            rate = zeta_1
        else:
            xs = -cx * o[0], -cx * o[1], -cx * o[2]
            po = _times(phi, o)
            zs = sign * 2 * z2 * po[0], sign * 2 * z2 * po[1], sign * 2 * z2 * po[2]
            mass_by = 0.0
            own, own1 = 2 * i2 * zeta * phi[0], 2 * i2 * (zeta_1 * phi[0] + zeta * phi[1])
            rate = phi[1]
        a, b = _times(x, zs), _times(z, xs)
        tilt = _times((a[0] - b[0], a[1] - b[1], a[2] - b[2]), over)
        r2_by = 2 * (x[0] * xs[0] + z[0] * zs[0])
        r2_by1 = 2 * (x[1] * xs[0] + x[0] * xs[1] + z[1] * zs[0] + z[0] * zs[1])
        by = by_slot[slot]
        by[L0], by[L1], by[L2] = zs[0] + (slot == 0), zs[1], zs[2]
        by[X0], by[X1], by[X2] = xs[0], xs[1], xs[2]
        by[T0], by[T1], by[T2] = tilt[0], tilt[1], tilt[2]
        by[MASS] = mass_by
        by[I0] = own - mass_by * r2[0] - mass * r2_by
        by[I1] = own1 - mass_by * r2[1] - mass1 * r2_by - mass * r2_by1
        inertia1 += by[I0] * rate
    return Body(za + z[0], za1 + z[1], za2 + z[2], x[0], x[1], x[2], tilt1, tilt2, mass, mass1, inertia, inertia1)


@fused
def second(
    c: Constants,
    m: Motion,
    i: int,
    body: Body,
    slots: Indices,
    by_slot: Floats,
    f_u: float,
    f_w: float,
    torque: float,
    spin2: float,
    out: Floats,
) -> None:
    """Derivative of the generalised force of a constant load by the shape: second derivatives of place and tilt
    times the force along and across and the torque, of the inertia times half of spin2."""
    cx, _, z2, i1, i2, _ = _factors(c)
    x, z, mass = body.x0, body.l0 - m.zeta[i, 0], body.mass
    o = 1 / (m.zeta[i, 0] + m.zeta[i, 1])
    turn, dif = m.phi[i, 0] + m.phi[i, 1], m.phi[i, 1] ** 2 - m.phi[i, 0] ** 2
    over = 1 / (x**2 + z**2)
    # tilt is the angle of x + i z, the imaginary part of its logarithm
    re2, im2, over4 = x**2 - z**2, 2 * x * z, over**2
    for at in range(len(slots)):
        for other in range(at + 1):
            a_slot, b_slot = max(slots[at], slots[other]), min(slots[at], slots[other])
            A, B = by_slot[a_slot], by_slot[b_slot]
            sa, fj = 2.0 * (a_slot % 2) - 1, m.phi[i, a_slot % 2]
            x_ab = z_ab = own = 0.0
            if a_slot < 2:  # both heights
                x_ab, z_ab = -2 * cx * turn * o**3, 2 * z2 * dif * o**3
                own = 6 * i1 * m.zeta[i, a_slot] if a_slot == b_slot else 0.0
            elif b_slot < 2:  # a an angle, b a height
                x_ab, z_ab = cx * o**2, -sa * 2 * z2 * fj * o**2
                own = 2 * i2 * fj if a_slot == b_slot + 2 else 0.0
            elif a_slot == b_slot:
                z_ab, own = sa * 2 * z2 * o, 2 * i2 * m.zeta[i, a_slot - 2]
            # of A and B only the shape's part: by[L0] of zeta_1 holds 1 more than z's
            az, bz = A[L0] - (a_slot == 0), B[L0] - (b_slot == 0)
            pr, pi = A[X0] * B[X0] - az * bz, A[X0] * bz + az * B[X0]
            tilt_ab = (x * z_ab - z * x_ab) * over - (pi * re2 - pr * im2) * over4
            r2_a, r2_b = 2 * (x * A[X0] + z * az), 2 * (x * B[X0] + z * bz)
            r2_ab = 2 * (A[X0] * B[X0] + az * bz + x * x_ab + z * z_ab)
            inertia_ab = own - A[MASS] * r2_b - B[MASS] * r2_a - mass * r2_ab
            value = f_u * z_ab + f_w * x_ab + torque * tilt_ab + spin2 / 2 * inertia_ab
            out[a_slot, b_slot] = out[b_slot, a_slot] = value
