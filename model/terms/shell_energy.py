"""A frustum's energy as a polynomial of finite elements, even in phi, with exact derivatives and an end at the slant.

U = C1 w^4 sum c_ij (zeta / L)^i (r_i phi / L)^2j, i + 2 j <= 10, where w = r_o - r_i and L is a little less than the
slant. The rim's two outermost points stand at zeta +- r_i phi, which a wall that does not stretch cannot bring beyond
the slant. There both are brought to rest smoothly, g(u) = L + d tanh((u - L) / d), and a stiff wall k (u - L)^3 takes
over: twice continuously differentiable, and pushed back from everywhere.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed, fused

Floats = NDArray[np.float64]

#: Total order of the polynomial.
ORDER = 10
#: A row: L in m (0: there is no such energy), d in m, k in N/m^2, the share of this energy beside equation 7's, then
#: coefficients in J: for each power of phi^2, from none to five, those by rising power of zeta.
HEAD, SHARE = 4, 3
POWERS = tuple((i, 2 * j) for j in range(ORDER // 2 + 1) for i in range(ORDER - 2 * j + 1))
ROW = HEAD + len(POWERS)
_AT = tuple(HEAD + POWERS.index((0, 2 * j)) for j in range(ORDER // 2 + 1))
AT0, AT1, AT2, AT3, AT4, AT5 = _AT


@fused
def _in_zeta(z: float, row: Floats, at: int, order: int) -> tuple[float, float]:
    """A polynomial in z alone and its derivative, by Horner's rule."""
    p, s = row[at + order], 0.0
    for i in range(order - 1, -1, -1):
        s = s * z + p
        p = p * z + row[at + i]
    return p, s


@fused
def _polynomial(z: float, w2: float, row: Floats) -> tuple[float, float, float]:
    """P and its derivatives by z and by w2, at z = zeta / L and w2 = (r_i phi / L)^2."""
    p0, s0 = _in_zeta(z, row, AT0, 10)
    p1, s1 = _in_zeta(z, row, AT1, 8)
    p2, s2 = _in_zeta(z, row, AT2, 6)
    p3, s3 = _in_zeta(z, row, AT3, 4)
    p4, s4 = _in_zeta(z, row, AT4, 2)
    p5 = row[AT5]
    value = p0 + w2 * (p1 + w2 * (p2 + w2 * (p3 + w2 * (p4 + w2 * p5))))
    by_z = s0 + w2 * (s1 + w2 * (s2 + w2 * (s3 + w2 * s4)))
    by_w2 = p1 + w2 * (2 * p2 + w2 * (3 * p3 + w2 * (4 * p4 + w2 * 5 * p5)))
    return value, by_z, by_w2


@allocates_nothing
def _ended(u: float, row: Floats) -> tuple[float, float, float, float]:
    """Where the rim's point at height u is brought to, the slope of that, and the wall's energy and force there."""
    beyond = abs(u) - row[0]
    if beyond <= 0:
        return u, 1.0, 0.0, 0.0
    t = math.tanh(beyond / row[1])
    sign = 1.0 if u > 0 else -1.0
    return sign * (row[0] + row[1] * t), 1 - t * t, row[2] * beyond**3, sign * 3 * row[2] * beyond**2


@exposed
def shell_force(zeta: float, phi: float, r_i: float, row: Floats) -> tuple[float, float]:
    """-F on zeta (N) and -M on phi (N m)."""
    L, w = row[0], r_i * phi
    if abs(zeta) + abs(w) <= L:
        _, by_z, by_w2 = _polynomial(zeta / L, (w / L) ** 2, row)
        return -by_z / L, -2 * r_i * w / L**2 * by_w2
    u, du, _, fu = _ended(zeta + w, row)
    v, dv, _, fv = _ended(zeta - w, row)
    z, x = (u + v) / 2, (u - v) / 2
    _, by_z, by_w2 = _polynomial(z / L, (x / L) ** 2, row)
    along, across = by_z / L, 2 * x / L**2 * by_w2
    by_u, by_v = (along + across) / 2 * du + fu, (along - across) / 2 * dv + fv
    return -(by_u + by_v), -r_i * (by_u - by_v)


@compiled
def shell_energy(zeta: float, phi: float, r_i: float, row: Floats) -> float:
    """Energy (J) that F and M derive from."""
    L, w = row[0], r_i * phi
    u, _, up, _ = _ended(zeta + w, row)
    v, _, down, _ = _ended(zeta - w, row)
    value, _, _ = _polynomial((u + v) / 2 / L, ((u - v) / 2 / L) ** 2, row)
    return float(value + up + down)


@allocates_nothing
def _second(z: float, w2: float, row: Floats) -> tuple[float, float, float]:
    """Second derivatives of P by z twice, by z and w2, by w2 twice."""
    zz = zw = ww = 0.0
    for j in range(ORDER // 2, -1, -1):
        p = s = c = 0.0
        order = ORDER - 2 * j
        at = HEAD + j * (ORDER + 2 - j)
        for i in range(order, -1, -1):
            c, s, p = c * z + s, s * z + p, p * z + row[at + i]
        zz = zz * w2 + 2 * c
        if j >= 1:
            zw = zw * w2 + j * s
        if j >= 2:
            ww = ww * w2 + j * (j - 1) * p
    return zz, zw, ww


@compiled
def shell_stiffness(zeta: float, phi: float, r_i: float, row: Floats) -> tuple[float, float, float]:
    """Exact second derivatives of the energy: by zeta twice (N/m), by zeta and phi (N), by phi twice (N m)."""
    L, d = row[0], row[1]
    heights = (zeta + r_i * phi, zeta - r_i * phi)
    u, du, _, _ = _ended(heights[0], row)
    v, dv, _, _ = _ended(heights[1], row)
    z, x = (u + v) / 2, (u - v) / 2
    w2 = (x / L) ** 2
    _, by_z, by_w2 = _polynomial(z / L, w2, row)
    zz, zw, ww = _second(z / L, w2, row)
    # by the polynomial's own z and x, in m
    along, across = by_z / L, 2 * x / L**2 * by_w2
    a, b = zz / L**2, zw * 2 * x / L**3
    c = 2 / L**2 * by_w2 + (2 * x / L**2) ** 2 * ww
    by_u, by_v = (along + across) / 2, (along - across) / 2
    uu, uv, vv = (a + 2 * b + c) / 4, (a - c) / 4, (a - 2 * b + c) / 4
    beyond_u, beyond_v = max(0.0, abs(heights[0]) - L), max(0.0, abs(heights[1]) - L)
    sign_u, sign_v = np.sign(heights[0]), np.sign(heights[1])
    bend_u = -2 * du * math.tanh(beyond_u / d) / d * sign_u
    bend_v = -2 * dv * math.tanh(beyond_v / d) / d * sign_v
    uu = uu * du**2 + by_u * bend_u + 6 * row[2] * beyond_u
    vv = vv * dv**2 + by_v * bend_v + 6 * row[2] * beyond_v
    uv = uv * du * dv
    return uu + 2 * uv + vv, r_i * (uu - vv), r_i**2 * (uu - 2 * uv + vv)
