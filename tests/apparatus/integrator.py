"""TR-BDF2 (Bank et al. 1985) over momenta and coordinates: trapezoidal rule, then BDF2, with one matrix."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from . import layout as at
from .physics import matrix, residual

GAMMA = 2.0 - sqrt(2.0)
PHI_SCALE = 50.0  # rad per m of zeta with an equal effect on the tip of a straw of a few cells
ERROR = (3.0 * GAMMA**2 - 4.0 * GAMMA + 2.0) / (6.0 * (2.0 - GAMMA))  # factor of Bank's error estimate, its magnitude
RECORD = 12  # time, tip pose (3), its rates (3), pressure, kinetic energy, powers of pressure and damping, flow
HALF = at.COORDINATES // 2


@njit(cache=True)
def factor(A):
    """LU in place without pivoting: the matrix is an inertia plus stiffnesses, large on its diagonal."""
    n = A.shape[0]
    for k in range(n):
        pivot = 1.0 / A[k, k]
        for i in range(k + 1, n):
            m = A[i, k] * pivot
            A[i, k] = m
            if m != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= m * A[k, j]


@njit(cache=True)
def solve(A, b):
    n = A.shape[0]
    for i in range(n):
        total = b[i]
        for j in range(i):
            total -= A[i, j] * b[j]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= A[i, j] * b[j]
        b[i] = total / A[i, i]


@njit(cache=True)
def size(b):
    """Largest change of a coordinate, angles as their displacement of the tip (m)."""
    largest = 0.0
    for i in range(at.COORDINATES):
        change = abs(b[i]) if i < HALF else abs(b[i]) / PHI_SCALE
        largest = max(largest, change) if change == change else np.inf
    return largest


@njit(cache=True)
def drive(t, p_start, p_step, p):
    """Pressure at the gauge: straight lines between samples every ``p_step`` seconds."""
    u = (t - p_start) / p_step
    i = int(u)
    if u <= 0.0:
        return p[0]
    if i >= len(p) - 1:
        return p[-1]
    return p[i] + (u - i) * (p[i + 1] - p[i])


@njit(cache=True)
def rest(q, p0, P, F):
    """Coordinates at rest under pressure ``p0`` (Pa), gravity increased in steps; False if there is none nearby."""
    y, c, R = np.zeros(at.STATES), np.zeros(at.STATES), np.zeros(at.COORDINATES)
    body, angle, tip = np.zeros((at.CELLS, 21)), np.zeros((at.CELLS, 5)), np.zeros(9)
    A = np.zeros((at.COORDINATES, at.COORDINATES))
    d = 1e-6
    c[at.STAGE_1] = c[at.STAGE_2] = -d * p0
    good = False
    for step in range(1, 17):
        good = False
        for _ in range(60):
            c[: at.COORDINATES] = -d * q
            residual(q, step / 16.0, p0, p0, 1e-9, c * 1e-3, y, P, F, R, body, angle, tip)
            c[at.FLOW : at.STATES] = -1e-6 * y[at.FLOW : at.STATES]
            matrix(q, p0, 0.0, 0.0, c * 0.0, P, F, body, angle, tip, A)
            factor(A)
            solve(A, R)
            moved = size(R)
            q -= R * min(1.0, 2e-4 / (moved + 1e-30))
            if moved < 1e-11:
                good = True
                break
        if not good:
            return False
    return good


@njit(cache=True)
def integrate(q, seconds, p_start, p_step, p_drive, tolerance, h_max, P, F, clock_zero):
    """Run from rest at ``q``; rows of RECORD numbers at each step, last coordinates, whether the end was reached."""
    n_y = at.STATES
    y, y_mid, y_new = np.zeros(n_y), np.zeros(n_y), np.zeros(n_y)
    r, r_mid, r_new, c = np.zeros(n_y), np.zeros(n_y), np.zeros(n_y), np.zeros(n_y)
    R, work = np.zeros(at.COORDINATES), np.zeros(at.COORDINATES)
    body, angle, tip = np.zeros((at.CELLS, 21)), np.zeros((at.CELLS, 5)), np.zeros(9)
    A = np.zeros((at.COORDINATES, at.COORDINATES))
    record, path = np.zeros((2048, RECORD)), np.zeros((2048, at.COORDINATES))
    P = P.copy()
    P[at.CLOCK] = clock_zero
    p = drive(0.0, p_start, p_step, p_drive)
    y[at.STAGE_1] = y[at.STAGE_2] = p
    d = 1e-6
    c[:] = -d * y
    c[: at.COORDINATES] = -d * q
    c[at.MOMENTA : at.FLOW] = 0.0
    p, impedance, flow = residual(q, 1.0, p, p, 0.0, c * 0.0, y, P, F, R, body, angle, tip)
    # The static solution has no memory variables: a line at rest has the pressure, gas its volume.
    start = drive(0.0, p_start, p_step, p_drive)
    y[at.STAGE_1] = y[at.STAGE_2] = p = start
    y[at.MOMENTA : at.FLOW] = 0.0
    y[at.FLOW] = 0.0
    y[at.BRANCHES :] = 0.0
    record[0, 1:8] = tip[0], tip[1], tip[2], 0.0, 0.0, 0.0, p
    path[0] = y[: at.COORDINATES]
    t, h, rows = 0.0, 1e-4, 1
    fresh_h, age, slow = 0.0, 1000, False
    while t < seconds:
        h = min(h, h_max)
        d = 2.0 / (GAMMA * h)
        ok = True
        for stage in range(2):
            if stage == 0:
                now, target = t + GAMMA * h, y_mid
                c[:] = -d * y - r
                for i in range(at.COORDINATES):
                    target[i] = y[i] + GAMMA * h * r[i]
            else:
                now, target = t + h, y_new
                c[:] = d * ((1.0 - GAMMA) ** 2 * y - y_mid) / (GAMMA * (2.0 - GAMMA))
                for i in range(at.COORDINATES):
                    target[i] = y_mid[i] + (1.0 - GAMMA) * h * r_mid[i]
            P[at.CLOCK] = clock_zero + now
            p_gauge = drive(now, p_start, p_step, p_drive)
            ok, before = False, 0.0
            for turn in range(12):
                p, impedance, flow = residual(
                    target[: at.COORDINATES], 1.0, p_gauge, p, d, c, target, P, F, R, body, angle, tip
                )
                if h != fresh_h or age > 40 or slow:
                    matrix(target[: at.COORDINATES], p, impedance, d, c, P, F, body, angle, tip, A)
                    factor(A)
                    fresh_h, age, slow = h, 0, False
                solve(A, R)
                moved = size(R)
                if moved < 0.01 * tolerance or moved < 1e-13:
                    for i in range(at.COORDINATES):
                        target[i] -= R[i]
                    ok = True
                    break
                if not moved < 1e-2:
                    break
                slow = turn > 0 and moved > 0.25 * before
                before = moved
                for i in range(at.COORDINATES):
                    target[i] -= R[i]
            age += 1
            if not ok:
                break
            p, impedance, flow = residual(
                target[: at.COORDINATES], 1.0, p_gauge, p, d, c, target, P, F, R, body, angle, tip
            )
            if stage == 0:
                r_mid[:] = d * y_mid + c
            else:
                r_new[:] = d * y_new + c
        if not ok:
            h *= 0.4
            slow = True
            if h < 1e-9:
                break
            continue
        for i in range(at.COORDINATES):
            work[i] = r[i] / GAMMA - r_mid[i] / (GAMMA * (1.0 - GAMMA)) + r_new[i] / (1.0 - GAMMA)
        error = ERROR * h * size(work) / tolerance
        factor_h = min(3.0, max(0.25, 0.85 * (error + 1e-12) ** (-1.0 / 3.0)))
        if error > 1.0:
            h *= factor_h
            continue
        t += h
        y[:] = y_new
        r[:] = r_new
        if rows == len(record):
            record, path = np.concatenate((record, np.zeros_like(record))), np.concatenate((path, np.zeros_like(path)))
        row = record[rows]
        row[0] = t
        row[1:7] = tip[:6]
        row[7], row[8], row[9], row[10], row[11] = p, tip[6], tip[7], tip[8], flow
        path[rows] = y[: at.COORDINATES]
        rows += 1
        if factor_h > 1.3:
            h *= min(factor_h, 2.0)
        elif factor_h < 1.0:
            h *= factor_h
    q[:] = y[: at.COORDINATES]
    return record[:rows], path[:rows], t >= seconds
