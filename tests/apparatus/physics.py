"""The paper's full straw: nine cells of two frusta each as rigid bodies, formulated as force balances of the bodies.

Lagrange's equations for bodies whose mass and inertia depend on q, with body velocity u = J(q) q', read
J^T d(m u)/dt - 1/2 |u|^2 dm/dq = Q: the momenta m u are states, so that the singular mass matrix is never inverted.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numba import njit

from . import layout as at
from .laws import channel, drag_n, frustum, tip_load_n, tip_moment_n_m

N = at.CELLS


@njit(cache=True)
def cell(z1, z2, f1, f2, P, out):
    """Mass, centre, inertia of one cell's water, and their slopes over (zeta_1, zeta_2, phi_1, phi_2).

    ``out``: m, x, z, I, dm/dzeta, then four slopes each of x, z, angle, I.
    """
    ri, ro, rho = P[at.R_I], P[at.R_O], P[at.RHO]
    s = z1 + z2
    area = ro * ro + ri * ri + ro * ri
    dm = rho * pi * area / 3.0
    m = dm * s
    x = -ro * ri * (f1 + f2) / (4.0 * s)
    a = 2.0 * (ro * ro + 3.0 * ri * ri + 2.0 * ro * ri)
    b = ro * ri * ri * (ro + 2.0 * ri)
    over = 8.0 * area * s
    z = (a * (z2 * z2 - z1 * z1) + b * (f2 * f2 - f1 * f1)) / over
    i1 = pi * rho * (ro * ro + 6.0 * ri * ri + 3.0 * ro * ri) / 30.0
    i2 = pi * rho * ri * ri * (ro * ro + ri * ri + 3.0 * ro * ri) / 20.0
    i3 = pi * rho * (ro**5 - ri**5) / (20.0 * (ro - ri))
    own = x * x + z * z
    out[0], out[1], out[2], out[4] = m, x, z, dm
    out[3] = i1 * (z1**3 + z2**3) + i2 * (z1 * f1 * f1 + z2 * f2 * f2) + i3 * s - m * own
    dx_phi = -ro * ri / (4.0 * s)
    out[5] = out[6] = -x / s
    out[7] = out[8] = dx_phi
    out[9], out[10] = -2.0 * a * z1 / over - z / s, 2.0 * a * z2 / over - z / s
    out[11], out[12] = -2.0 * b * f1 / over, 2.0 * b * f2 / over
    out[17], out[18] = 3.0 * i1 * z1 * z1 + i2 * f1 * f1 + i3, 3.0 * i1 * z2 * z2 + i2 * f2 * f2 + i3
    out[19], out[20] = 2.0 * i2 * z1 * f1, 2.0 * i2 * z2 * f2
    for k in range(4):
        dx, dz = out[5 + k], out[9 + k]
        out[13 + k] = (x * dz - z * dx) / own
        out[17 + k] -= (dm if k < 2 else 0.0) * own + 2.0 * m * (x * dx + z * dz)


@njit(cache=True)
def residual(q, t_gravity, p_gauge, p_guess, d, c, y, P, F, R, body, angle, tip):
    """Unbalanced generalised forces R for coordinates q whose rates are d q + c; momenta and memories go into y.

    Fills ``body`` (cells' table), ``angle`` (directions), ``tip`` (x, z, phi, their rates, kinetic energy, and powers
    of pressure and damping). Returns pressure inside (Pa), -dp/d(volume rate) and flow.
    """
    ri = P[at.R_I]
    c3 = pi * (P[at.R_O] ** 2 - 2.0 * ri * ri + P[at.R_O] * ri) / 3.0
    end = pi * ri * ri
    length = rate = 0.0
    for i in range(2 * N):
        length += q[i]
        rate += d * q[i] + c[i]
    p, flow, gas, first, second, impedance = channel((c3 + end) * rate, (c3 + end) * length, p_gauge, p_guess, d, c, P)
    y[at.FLOW], y[at.GAS], y[at.STAGE_1], y[at.STAGE_2] = flow, gas, first, second
    g = P[at.GRAVITY] * t_gravity

    # Outwards: position and velocity of each body, its momenta and the residual force on it.
    phi, turn = P[at.BASE_ANGLE], 0.0
    jx = jz = jvx = jvz = kinetic = 0.0
    for n in range(N):
        q1, q2, q3, q4 = n, N + n, 2 * N + n, 3 * N + n
        v1, v2, v3, v4 = d * q[q1] + c[q1], d * q[q2] + c[q2], d * q[q3] + c[q3], d * q[q4] + c[q4]
        b = body[n]
        cell(q[q1], q[q2], q[q3], q[q4], P, b)
        phi += q[q3]
        turn += v3
        ex, ez = sin(phi), cos(phi)
        angle[n, 0], angle[n, 1] = ex, ez
        a, x = q[q1] + b[2], b[1]
        vx = b[5] * v1 + b[6] * v2 + b[7] * v3 + b[8] * v4
        va = v1 + b[9] * v1 + b[10] * v2 + b[11] * v3 + b[12] * v4
        spin = turn + b[13] * v1 + b[14] * v2 + b[15] * v3 + b[16] * v4
        along, across = va - x * turn, a * turn + vx
        ux, uz = jvx + along * ex + across * ez, jvz + along * ez - across * ex
        k = at.MOMENTA + 3 * n
        y[k], y[k + 1], y[k + 2] = b[0] * ux, b[0] * uz, b[3] * spin
        fx, fz = 0.0, -b[0] * g
        if P[at.DRAG] > 0.0:
            fx, fz = drag_n(ux, uz, 0.05, P)
            fz -= b[0] * g
        angle[n, 2], angle[n, 3] = fx - (d * y[k] + c[k]), fz - (d * y[k + 1] + c[k + 1])
        angle[n, 4] = -(d * y[k + 2] + c[k + 2])
        speed2 = ux * ux + uz * uz
        kinetic += 0.5 * (b[0] * speed2 + b[3] * spin * spin)
        for j in range(4):
            R[j * N + n] = -0.5 * spin * spin * b[17 + j]
        R[q1] -= 0.5 * speed2 * b[4]
        R[q2] -= 0.5 * speed2 * b[4]
        s, sv = q[q1] + q[q2], v1 + v2
        jx += s * ex
        jz += s * ez
        jvx += sv * ex + s * turn * ez
        jvz += sv * ez - s * turn * ex
        phi += q[q4]
        turn += v4
    k = at.MOMENTA + 3 * N
    y[k], y[k + 1], y[k + 2] = P[at.M_TIP] * jvx, P[at.M_TIP] * jvz, P[at.I_TIP] * turn
    kinetic += 0.5 * (P[at.M_TIP] * (jvx * jvx + jvz * jvz) + P[at.I_TIP] * turn * turn)
    fx, fz = tip_load_n(jx, jz, jvx, jvz, P)
    if P[at.DRAG] > 0.0:
        ax, az = drag_n(jvx, jvz, 0.55, P)
        fx += ax
        fz += az
    gx = fx + end * p * sin(phi) - (d * y[k] + c[k])
    gz = fz + end * p * cos(phi) - P[at.M_TIP] * g - (d * y[k + 1] + c[k + 1])
    moment = tip_moment_n_m(phi, P)[0] - (d * y[k + 2] + c[k + 2])
    tip[0], tip[1], tip[2], tip[3], tip[4], tip[5], tip[6] = jx, jz, phi, jvx, jvz, turn, kinetic
    tip[7] = p * (c3 * rate + end * (jvx * sin(phi) + jvz * cos(phi)))
    tip[8] = 0.0

    # Inwards: generalised forces of the loads beyond each joint on its coordinates.
    for n in range(N - 1, -1, -1):
        b = body[n]
        ex, ez, bx, bz, bm = angle[n, 0], angle[n, 1], angle[n, 2], angle[n, 3], angle[n, 4]
        q1, q2 = n, N + n
        s = q[q1] + q[q2]
        R[3 * N + n] -= moment
        moment += s * (ez * gx - ex * gz)
        beyond = ex * gx + ez * gz
        along, across = ex * bx + ez * bz, ez * bx - ex * bz
        moment += (q[q1] + b[2]) * across - b[1] * along + bm
        R[2 * N + n] -= moment
        R[q1] -= beyond + along
        R[q2] -= beyond
        for j in range(4):
            R[j * N + n] -= across * b[5 + j] + along * b[9 + j] + bm * b[13 + j]
        gx += bx
        gz += bz
    for i in range(2 * N):
        zeta_rate, phi_rate = d * q[i] + c[i], d * q[2 * N + i] + c[2 * N + i]
        m = i - N
        force, moment, s1, s2, s3, bristle = frustum(
            i >= N, q[i], q[2 * N + i], zeta_rate, phi_rate, p, d, c, m, P, F[i]
        )
        tip[8] += F[i, at.C_ZETA] * zeta_rate**2 + F[i, at.C_PHI] * phi_rate**2
        R[i] += force - c3 * p
        R[2 * N + i] += moment
        if i >= N:
            k = at.BRANCHES + at.BRANCH_COUNT * m
            y[k], y[k + 1], y[k + 2] = s1, s2, s3
            y[at.BRISTLES + m] = bristle
    for i in range(at.COORDINATES):
        y[i] = q[i]
    return p, impedance, flow


@njit(cache=True)
def matrix(q, p, impedance, d, c, P, F, body, angle, tip, A):
    """dR/dq for Newton, up to gravity's and gyroscopic terms: inertia, frusta, channel, and the follower's turning."""
    ri = P[at.R_I]
    c3 = pi * (P[at.R_O] ** 2 - 2.0 * ri * ri + P[at.R_O] * ri) / 3.0
    end = pi * ri * ri
    A[:] = 0.0
    J = np.zeros((3, at.COORDINATES))
    for n in range(N + 1):  # J of the joint before cell n, completed by the cell's own coordinates
        if n < N:
            b = body[n]
            ex, ez = angle[n, 0], angle[n, 1]
            K = J.copy()
            mass, inertia = b[0], b[3]
            a = q[n] + b[2]
            for m in range(n + 1):
                K[0, 2 * N + m] += a * ez - b[1] * ex
                K[1, 2 * N + m] += -a * ex - b[1] * ez
                K[2, 2 * N + m] = 1.0
                if m < n:
                    K[0, 3 * N + m] += a * ez - b[1] * ex
                    K[1, 3 * N + m] += -a * ex - b[1] * ez
                    K[2, 3 * N + m] = 1.0
            for j in range(4):
                dx, dz = b[5 + j], b[9 + j] + (1.0 if j == 0 else 0.0)
                K[0, j * N + n] += dz * ex + dx * ez
                K[1, j * N + n] += dz * ez - dx * ex
                K[2, j * N + n] += b[13 + j]
        else:
            K = J
            mass, inertia = P[at.M_TIP], P[at.I_TIP]
            K[2, 2 * N :] = 1.0
        for i in range(at.COORDINATES):
            if i % N <= n:
                a0, a1, a2 = d * d * mass * K[0, i], d * d * mass * K[1, i], d * d * inertia * K[2, i]
                for j in range(at.COORDINATES):
                    A[i, j] += a0 * K[0, j] + a1 * K[1, j] + a2 * K[2, j]
        if n < N:
            s = q[n] + q[N + n]
            for m in range(n + 1):
                J[0, 2 * N + m] += s * ez
                J[1, 2 * N + m] -= s * ex
                if m < n:
                    J[0, 3 * N + m] += s * ez
                    J[1, 3 * N + m] -= s * ex
            J[0, n], J[1, n], J[0, N + n], J[1, N + n] = ex, ez, ex, ez
    tx, tz = sin(tip[2]), cos(tip[2])
    for i in range(at.COORDINATES):  # pressure depends on the volume rate
        w = end * (J[0, i] * tx + J[1, i] * tz) + (c3 if i < 2 * N else 0.0)
        w *= impedance * d * (c3 + end)
        for j in range(2 * N):
            A[i, j] += w
    for i in range(at.COORDINATES):  # and rotates with the tip
        load = end * p * (J[0, i] * tz - J[1, i] * tx)
        for j in range(2 * N, at.COORDINATES):
            A[i, j] -= load
    for n in range(N):  # minus the rotation of each cell's own axis
        ex, ez = angle[n, 0], angle[n, 1]
        load = end * p * (q[n] + q[N + n]) * (ex * tx + ez * tz)
        for m in range(n + 1):
            for k in range(n + 1):
                A[2 * N + m, 2 * N + k] += load
                if k < n:
                    A[2 * N + m, 3 * N + k] += load
                if m < n:
                    A[3 * N + m, 2 * N + k] += load
                if m < n and k < n:
                    A[3 * N + m, 3 * N + k] += load
    step = 1e-8
    fx, fz = tip_load_n(tip[0], tip[1], tip[3], tip[4], P)
    xx, zx = tip_load_n(tip[0] + step, tip[1], tip[3] + d * step, tip[4], P)
    xz, zz = tip_load_n(tip[0], tip[1] + step, tip[3], tip[4] + d * step, P)
    xx, zx, xz, zz = (xx - fx) / step, (zx - fz) / step, (xz - fx) / step, (zz - fz) / step
    if xx != 0.0 or zz != 0.0 or xz != 0.0:
        for i in range(at.COORDINATES):
            a0, a1 = J[0, i] * xx + J[1, i] * zx, J[0, i] * xz + J[1, i] * zz
            for j in range(at.COORDINATES):
                A[i, j] -= a0 * J[0, j] + a1 * J[1, j]
    stiffness = -tip_moment_n_m(tip[2], P)[1]
    if stiffness != 0.0:
        A[2 * N :, 2 * N :] += stiffness
    for i in range(2 * N):
        v, w, m, j = d * q[i] + c[i], d * q[2 * N + i] + c[2 * N + i], i - N, 2 * N + i
        f0, m0, _, _, _, _ = frustum(i >= N, q[i], q[j], v, w, p, d, c, m, P, F[i])
        step = 1e-9
        f1, m1, _, _, _, _ = frustum(i >= N, q[i] + step, q[j], v + d * step, w, p, d, c, m, P, F[i])
        A[i, i] += (f1 - f0) / step
        A[j, i] += (m1 - m0) / step
        step = 1e-7
        f1, m1, _, _, _, _ = frustum(i >= N, q[i], q[j] + step, v, w + d * step, p, d, c, m, P, F[i])
        A[i, j] += (f1 - f0) / step
        A[j, j] += (m1 - m0) / step
