"""Walls other than equation 7's: energy of a frustum by finite elements, as the apparatus's own Chebyshev series.

    python -m tests.apparatus.walls

solves the shell at Chebyshev's points and writes ``walls.json``. Only the solver is the package's, which NGSolve checks
(`tests.benchmarks.shell_second_code`); not its polynomial, its end at the slant, or how it is scaled to thickness and
height. The series is in u = zeta + r_i phi and v = zeta - r_i phi, the heights of two opposite points of the rim,
within LIMIT_M either way; V(u, v) = V(v, u).
"""

from __future__ import annotations

import json
from functools import lru_cache
from math import pi
from pathlib import Path

import numpy as np
from numba import njit

FILE = Path(__file__).with_name("walls.json")
POINTS, LIMIT_M = 17, 3.7e-3
#: The cone of the recordings, and the changes of thickness and height for their tables.
R_I, R_O, ZETA_0, THICKNESS, MOVED = 0.0111, 0.01465, -2.28e-3, 0.508e-3, 0.02
NODES = np.cos(pi * (np.arange(POINTS) + 0.5) / POINTS)


def solved(zeta_0: float, thickness: float) -> np.ndarray:
    """Energies (POINTS, POINTS) at LIMIT_M NODES by NODES of a cone of 1 Pa, J/Pa."""
    from straw.model.shell.problem import Problem
    from straw.model.shell.profile import frustum
    from straw.model.shell.threads import one_thread

    e_pa = 0.92e9
    made = np.zeros((POINTS, POINTS))
    with one_thread():
        model, first = Problem(frustum(R_I, R_O, zeta_0, thickness), e_pa).model(), None
        for i in range(POINTS):
            point = first
            for j in range(i, POINTS):  # nodes fall: phi >= 0
                u, v = LIMIT_M * NODES[i], LIMIT_M * NODES[j]
                point = model.at(float(u + v) / 2, float(u - v) / (2 * R_I), point)
                first = point if i == j else first
                made[i, j] = made[j, i] = point.energy_j / e_pa
    return made


def series(values: np.ndarray) -> np.ndarray:
    """Coefficients (POINTS, POINTS) of T_m(u / LIMIT_M) T_n(v / LIMIT_M) from values at the nodes."""
    k = np.arange(POINTS)
    T = np.cos(np.outer(k, pi * (k + 0.5) / POINTS)) * np.where(k == 0, 1, 2)[:, None] / POINTS
    return T @ values @ T.T


@lru_cache(maxsize=64)
def table(zeta_0: float, thickness: float) -> np.ndarray:
    """Coefficients for a cone of this height and thickness, to second order in both."""
    kept = {name: series(np.array(values)) for name, values in json.loads(FILE.read_text()).items()}
    cone, both = kept["cone"], kept["both more"] - kept["height more"] - kept["thickness more"] + kept["cone"]
    x, y = (zeta_0 / ZETA_0 - 1) / MOVED, (thickness / THICKNESS - 1) / MOVED
    made = cone + x * y * both
    for name, share in (("height", x), ("thickness", y)):
        low, high = kept[f"{name} less"], kept[f"{name} more"]
        made += share * (high - low) / 2 + share**2 * (high + low - 2 * cone) / 2
    return made


@njit(cache=True)
def _value_and_slopes(x, y, C, start):
    """sum C T_m(x) T_n(y) and its derivatives by x and y; C lies flat from ``start`` on."""
    n = POINTS
    value = by_x = by_y = 0.0
    tx0, tx1, dx0, dx1 = 1.0, x, 0.0, 1.0
    for i in range(n):
        inner = inner_slope = 0.0
        ty0, ty1, dy0, dy1 = 1.0, y, 0.0, 1.0
        for j in range(n):
            c = C[start + i * n + j]
            inner += c * ty0
            inner_slope += c * dy0
            ty0, ty1, dy0, dy1 = ty1, 2.0 * y * ty1 - ty0, dy1, 2.0 * ty1 + 2.0 * y * dy1 - dy0
        value += tx0 * inner
        by_x += dx0 * inner
        by_y += tx0 * inner_slope
        tx0, tx1, dx0, dx1 = tx1, 2.0 * x * tx1 - tx0, dx1, 2.0 * tx1 + 2.0 * x * dx1 - dx0
    return value, by_x, by_y


@njit(cache=True)
def wall_force(zeta, phi, r_i, C, start):
    """Force (N) and moment (N m) that hold a frustum there, per Pa of modulus; beyond the limit a stiff stop."""
    u, v = zeta + r_i * phi, zeta - r_i * phi
    inside_u, inside_v = min(max(u, -LIMIT_M), LIMIT_M), min(max(v, -LIMIT_M), LIMIT_M)
    _, by_u, by_v = _value_and_slopes(inside_u / LIMIT_M, inside_v / LIMIT_M, C, start)
    by_u = by_u / LIMIT_M + 5e-5 * (u - inside_u)  # 46 kN/m for a wall of 0.92 GPa
    by_v = by_v / LIMIT_M + 5e-5 * (v - inside_v)
    return by_u + by_v, r_i * (by_u - by_v)


def main() -> None:
    """Solve and write the six tables."""
    made = {"cone": solved(ZETA_0, THICKNESS)}
    for name, sign in (("less", -1), ("more", 1)):
        made[f"height {name}"] = solved(ZETA_0 * (1 + sign * MOVED), THICKNESS)
        made[f"thickness {name}"] = solved(ZETA_0, THICKNESS * (1 + sign * MOVED))
    made["both more"] = solved(ZETA_0 * (1 + MOVED), THICKNESS * (1 + MOVED))
    FILE.write_text(json.dumps({name: [[float(f"{x:.10e}") for x in row] for row in v] for name, v in made.items()}))


if __name__ == "__main__":
    main()
