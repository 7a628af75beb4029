"""Equilibria of an unloaded or pressurised frustum or cell, barriers, and the pressures at which its states end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from straw.model.frustum import Frustum
from straw.model.shell.problem import Problem
from straw.model.shell.solve import Model, NotFoundError, Point
from straw.model.shell.strain import Floats

#: Newton over (zeta, phi) has arrived at steps this small, in zeta over r_i and phi.
CLOSE = 1e-8
NEWTON_LIMIT = 20
LONGEST_STEP = 0.03


@dataclass(frozen=True)
class Balance:
    """An equilibrium without a force on the base; ``stiffness`` are its eigenvalues by (zeta / r_i, phi), N m."""

    point: Point
    stiffness: tuple[float, float]

    @property
    def stable(self) -> bool:
        """Whether every small displacement is pushed back, the wall's own included."""
        return min(self.stiffness) > 0 and self.point.stable


def eigenvalues(point: Point, r_i: float) -> tuple[float, float]:
    """Eigenvalues of a point's stiffness by (zeta / r_i, phi), N m."""
    scale = np.array([r_i, 1.0])
    low, high = np.linalg.eigvalsh(point.stiffness * scale * scale[:, None])
    return float(low), float(high)


def balance(model: Model, zeta_m: float, phi_rad: float, near: Point | None = None) -> Balance | None:
    """The equilibrium that Newton's method finds from a first guess; None where it leads nowhere."""
    r_i = model.held.r_i
    try:
        point = model.at(zeta_m, phi_rad, near)
        for _ in range(NEWTON_LIMIT):
            straight = point.phi_rad == 0
            K = point.stiffness * np.outer([r_i, 1.0], [r_i, 1.0])
            f = np.array([point.force_n * r_i, point.moment_n_m])
            step = np.array([-f[0] / K[0, 0], 0.0]) if straight else -np.linalg.solve(K, f)
            step *= min(1.0, LONGEST_STEP / np.abs(step).max()) if np.any(step) else 1.0
            point = model.at(point.zeta_m + r_i * step[0], point.phi_rad + step[1], point)
            if np.abs(step).max() < CLOSE:
                return Balance(point, eigenvalues(point, r_i))
    except (NotFoundError, np.linalg.LinAlgError):
        pass
    return None


def balances(problem: Problem, guesses: list[tuple[float, float]]) -> list[Balance]:
    """Equilibria with phi of zero and above that lie near guesses (zeta, phi), each once, straight ones first."""
    straight = problem.barely_tilted().model()
    bent = problem.model()
    found: list[Balance] = []
    near: Point | None = None
    for zeta, phi in guesses:
        if phi == 0:
            one = balance(straight, zeta, 0.0)
        else:
            near = bent.at(zeta, 0.0, near)
            one = balance(bent, zeta, phi, near)
        if one and one.point.phi_rad >= 0 and not any(_same(one, other, problem) for other in found):
            found.append(one)
    return found


def _same(a: Balance, b: Balance, problem: Problem) -> bool:
    away = abs(a.point.zeta_m - b.point.zeta_m) / problem.profile.r_i_m + abs(a.point.phi_rad - b.point.phi_rad)
    return away < 1e-5


def guesses_of(frustum: Frustum, offset_m: float = 0.0) -> list[tuple[float, float]]:
    """Where the reduced model has its equilibria, phi zero and above."""
    return [(e.zeta_m + offset_m, e.phi_rad) for e in frustum.equilibria() if e.phi_rad >= 0]


@dataclass(frozen=True)
class StraightEnd:
    """Where a straight state ends as pressure grows: at what pressure and height, tilting or snapping straight."""

    pressure_pa: float
    zeta_m: float
    tilts: bool
    pressure_straight_pa: float  # at which it would snap straight were it kept from tilting


def _pressure(model: Model, zeta: float, phi: float, near: Point, sealed: bool) -> tuple[float, Point]:
    """Pressure under which no axial force is needed at (zeta, phi), and the point there."""
    pressure = model.pressure_pa
    point = model.at(zeta, phi, near)
    for _ in range(NEWTON_LIMIT):
        area = 0.0 if sealed else point.base_area_m2
        step = (point.force_n + pressure * area) / (point.volume_slope[0] - area)
        pressure += step
        model = model.under(pressure)
        point = model.at(zeta, phi, point)
        if abs(step) < 1e-3:
            break
    return pressure, point


def straight_end(problem: Problem, folded: bool, sealed: bool = True) -> StraightEnd:
    """The pressure at which a frustum's folded (unloaded) or deployed straight state ends.

    ``sealed``: the end is closed and pulls with the pressure on the base as it is; else the pressure acts on the wall
    alone. Along the state p(zeta) has its extreme where the frustum snaps straight; it tilts where dM/dphi is zero.
    """
    frustum = problem.barely_tilted().model()
    z0 = problem.profile.height_m
    side = z0 if folded else -z0
    zetas = side * np.linspace(1.0 if folded else 0.9, 0.35, 27)
    found: list[tuple[float, float, Point]] = []
    near: Point | None = None
    pressure = 0.0
    for zeta in zetas:
        model = frustum.under(pressure)
        near = model.at(zeta, 0.0, near)
        pressure, near = _pressure(model, zeta, 0.0, near, sealed)
        found.append((float(zeta), pressure, near))
    p = np.array([pressure for _, pressure, _ in found])
    sign = -np.sign(z0) if folded else np.sign(z0)
    top = int(np.argmax(sign * p))

    def at(zeta: float) -> tuple[float, Point]:
        i = int(np.argmin([abs(zeta - z) for z, _, _ in found]))
        return _pressure(frustum.under(found[i][1]), zeta, 0.0, found[i][2], sealed)

    low, high = found[max(top - 1, 0)][0], found[min(top + 1, len(found) - 1)][0]
    best = minimize_scalar(
        lambda z: -sign * at(z)[0], bounds=(min(low, high), max(low, high)), method="bounded", options={"xatol": 1e-7}
    )
    peak_zeta, peak = float(best.x), float(-sign * best.fun) if sign < 0 else float(-best.fun)
    bending = np.array([point.stiffness[1, 1] for _, _, point in found])
    first = next((i for i in range(1, len(found)) if bending[i] <= 0), None)
    if first is not None and first <= top + 1:
        z = brentq(lambda x: at(x)[1].stiffness[1, 1], found[first - 1][0], found[first][0], xtol=1e-8)
        if abs(z) > abs(peak_zeta):
            return StraightEnd(at(z)[0], float(z), True, peak)
    return StraightEnd(peak, peak_zeta, False, peak)


def softening_heights(problem: Problem) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Heights of an unloaded-pressure frustum at which axial and bending stiffness of the straight shape vanish, m."""
    model = problem.barely_tilted().model()
    z0 = abs(problem.profile.height_m)
    zetas = np.linspace(-0.9 * z0, 0.9 * z0, 41)
    near = model.at(float(zetas[0]), 0.0)
    points = []
    for z in zetas:
        near = model.at(float(z), 0.0, near)
        points.append(near)

    def zeros(i: int) -> tuple[float, ...]:
        values = [p.stiffness[i, i] for p in points]
        return tuple(
            float(brentq(lambda x, k=k: model.at(x, 0.0, points[k]).stiffness[i, i], zetas[k], zetas[k + 1], xtol=1e-8))
            for k in range(len(points) - 1)
            if values[k] * values[k + 1] < 0
        )

    return zeros(0), zeros(1)


def bent_end(problem: Problem, bent: Point, upwards: bool, sealed: bool = True) -> tuple[float, float, float]:
    """Pressure at which the bent state ends as pressure rises or falls, with zeta and phi there.

    Along the bent branch, M = 0 and F = 0 in (phi, p) at each zeta; the state ends where p(zeta) has its extreme.
    """
    base = problem.model()
    state: dict[str, Any] = {"point": bent, "pressure": 0.0}

    def at(zeta: float) -> float:
        point, pressure = state["point"], float(state["pressure"])
        model = base.under(pressure)
        point = model.at(zeta, point.phi_rad, point)
        for _ in range(NEWTON_LIMIT):
            area = 0.0 if sealed else point.base_area_m2
            f = np.array([point.force_n + pressure * area, point.moment_n_m])
            J = np.array(
                [
                    [point.stiffness[0, 1], -point.volume_slope[0] + area],
                    [point.stiffness[1, 1], -point.volume_slope[1]],
                ]
            )
            step = -np.linalg.solve(J, f)
            pressure += float(step[1])
            point = base.under(pressure).at(zeta, point.phi_rad + float(step[0]), point)
            if abs(step[0]) < 1e-7 and abs(step[1]) < 0.1:
                break
        state.update(point=point, pressure=pressure)
        return pressure

    step = 0.1e-3 * (1 if upwards else -1)
    sign = 1 if upwards else -1
    zeta, last = bent.zeta_m, 0.0
    heights = [zeta]
    for _ in range(40):
        zeta += step
        p = at(zeta)
        heights.append(zeta)
        if sign * p < sign * last:
            break
        last = p
    low, high = sorted((heights[-3] if len(heights) > 2 else heights[0], heights[-1]))
    best = minimize_scalar(lambda z: -sign * at(z), bounds=(low, high), method="bounded", options={"xatol": 1e-6})
    at(float(best.x))
    point = state["point"]
    return float(-sign * best.fun), float(best.x), float(point.phi_rad)


def straight_curve(problem: Problem, zetas_m: Floats) -> Floats:
    """Energy (J), force (N), axial stiffness (N/m) and bending stiffness (N m) at phi = 0: (n, 4)."""
    model = problem.barely_tilted().model()
    near: Point | None = None
    rows = []
    for zeta in zetas_m:
        near = model.at(float(zeta), 0.0, near)
        rows.append([near.energy_j, near.force_n, near.stiffness[0, 0], near.stiffness[1, 1]])
    return np.array(rows)
