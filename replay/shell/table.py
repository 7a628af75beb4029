"""A frustum by finite elements beside equation 7: equilibria, barriers, forces, pressures, one row each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from straw.model.errors import ModelError
from straw.model.frustum import Frustum
from straw.model.shell.equilibria import (
    Balance,
    balances,
    bent_end,
    guesses_of,
    softening_heights,
    straight_curve,
    straight_end,
)
from straw.model.shell.problem import Problem


@dataclass(frozen=True)
class Row:
    """One quantity: reduced and by finite elements, in the unit shown; NaN where there is none."""

    name: str
    unit: str
    reduced: float
    shell: float

    @property
    def difference(self) -> float:
        """Finite elements minus reduced."""
        return self.shell - self.reduced


def reduced_frustum(problem: Problem, *, sealed: bool = False) -> Frustum:
    """Equation 7's frustum of a problem's radii, height and mean thickness."""
    wall = problem.profile.walls[-1]
    h = float(np.mean(wall.thickness_m))
    r_i, r_o = sorted((float(wall.points_m[0, 0]), float(wall.points_m[-1, 0])))
    zeta0 = float(wall.points_m[-1, 1] - wall.points_m[0, 1])
    w, log = r_o - r_i, math.log(r_o / r_i)
    C1 = math.pi * problem.E_pa * h / (8 * w**3) * ((r_o + r_i) / 2 - w / log)
    C2 = math.pi * problem.E_pa * h**3 * log / (12 * w**2)
    face = math.pi * (r_o**2 - 2 * r_i**2 + r_o * r_i) / 3
    return Frustum(C1, C2, r_i, zeta0, face + (math.pi * r_i**2 if sealed else 0.0))


def frustum_table(problem: Problem, tell: Callable[[int, int], None] | None = None) -> tuple[list[Row], list[Balance]]:
    """All rows for a frustum that is not loaded, and its equilibria with phi of zero and above."""
    steps = 7

    def done(k: int) -> None:
        if tell:
            tell(k, steps)

    flat = reduced_frustum(problem)
    done(0)
    found = balances(problem, guesses_of(flat))
    done(1)
    angles = [[phi for _, phi in guesses_of(flat)], [b.point.phi_rad for b in found]]
    rows = [Row("equilibria, with those at -phi", "", *(float(sum(2 if phi else 1 for phi in one)) for one in angles))]
    rows += _equilibria(flat, found)
    rows += _barriers(flat, found)
    rows += _forces(problem, flat)
    done(2)
    axial, bending = softening_heights(problem)
    width = math.sqrt(max(0.0, (4 * flat.zeta0**2 - flat.C2 / flat.C1) / 12)) * 1e3
    for name, heights in (("axial", axial), ("bending", bending)):
        for side, height in zip((-1, 1), heights, strict=False):
            rows.append(Row(f"zeta where {name} stiffness vanishes", "mm", side * width, 1e3 * height))
    done(3)
    rows += _pressures(problem, found, lambda k: done(3 + k))
    rows.append(Row("slant, which |zeta| + r_i |phi| cannot exceed", "mm", math.nan, 1e3 * problem.slant_m))
    return rows, found


def _equilibria(flat: Frustum, found: list[Balance]) -> list[Row]:
    rows = []
    known = [e for e in flat.equilibria() if e.phi_rad >= 0]
    for e in known:
        near = [b for b in found if (b.point.phi_rad > 0) == (e.phi_rad > 0) and b.stable == e.stable]
        near.sort(key=lambda b: abs(b.point.zeta_m - e.zeta_m))
        b = near[0] if near else None
        kind = "stable" if e.stable else "saddle or top"
        what = f"{kind}, {'bent' if e.phi_rad else 'straight'} at {1e3 * e.zeta_m:.2f} mm"
        energy = 1e3 * float(flat.energy(np.array(e.zeta_m), np.array(e.phi_rad)))
        rows.append(Row(f"{what}: zeta", "mm", 1e3 * e.zeta_m, 1e3 * b.point.zeta_m if b else math.nan))
        if e.phi_rad:
            rows.append(Row(f"{what}: |phi|", "rad", e.phi_rad, b.point.phi_rad if b else math.nan))
        rows.append(Row(f"{what}: energy", "mJ", energy, 1e3 * b.point.energy_j if b else math.nan))
    return rows


#: Energies by state: (zeta, |phi|, stable, energy in mJ).
States = list[tuple[float, float, bool, float]]


def _barriers(flat: Frustum, found: list[Balance]) -> list[Row]:
    """Energies of the saddles above the states they part: what a snap costs without a load, in either direction."""
    known = [e for e in flat.equilibria() if e.phi_rad >= 0]
    reduced = [
        (e.zeta_m, e.phi_rad, e.stable, 1e3 * float(flat.energy(np.array(e.zeta_m), np.array(e.phi_rad))))
        for e in known
    ]
    shell = [(b.point.zeta_m, b.point.phi_rad, b.stable, 1e3 * b.point.energy_j) for b in found]
    both = [_barriers_of(states) for states in (reduced, shell)]
    return [Row(f"barrier, {name}", "mJ", both[0][name], both[1][name]) for name in both[0] if name in both[1]]


def _barriers_of(states: States) -> dict[str, float]:
    """Barriers by the way they bar; empty where the frustum has not the paper's four stable states and saddles."""
    straight = sorted(z for z, phi, stable, _ in states if stable and phi == 0)
    bent = [z for z, phi, stable, _ in states if stable and phi > 0]
    saddles = sorted(z for z, phi, stable, _ in states if not stable and phi > 0)
    if (len(straight), len(bent), len(saddles)) != (2, 1, 2):
        return {}
    energy = {(z, stable): e for z, phi, stable, e in states if phi > 0 or stable}
    out = {}
    for end, saddle in zip(straight, saddles, strict=True):
        name = "folded" if end < 0 else "deployed"
        out[f"{name} to bent"] = energy[saddle, False] - energy[end, True]
        out[f"bent to {name}"] = energy[saddle, False] - energy[bent[0], True]
    return out


def _forces(problem: Problem, flat: Frustum) -> list[Row]:
    """Largest forces along phi = 0 between the states, and the stiffness of the unloaded shape."""
    z0 = abs(flat.zeta0)
    z = np.linspace(-z0, 0.95 * z0, 80)
    curve = straight_curve(problem, z)
    forces = np.array([flat.force(float(x), 0.0)[0] for x in z])
    inside = np.abs(z) < 0.85 * z0
    K = flat.stiffness(flat.zeta0, 0.0)
    start = straight_curve(problem, np.array([flat.zeta0]))[0]

    def peak(values: np.ndarray, sign: int) -> float:
        i = int(np.argmax(np.where(inside, sign * values, -np.inf)))
        a, b, c = values[i - 1 : i + 2]
        return float(b - (a - c) ** 2 / (8 * (a - 2 * b + c)))  # the parabola through three points

    return [
        Row("largest force, up", "N", peak(forces, 1), peak(curve[:, 1], 1)),
        Row("largest force, down", "N", peak(forces, -1), peak(curve[:, 1], -1)),
        Row("axial stiffness, unloaded", "kN/m", K[0, 0] / flat.r_i**2 / 1e3, start[2] / 1e3),
        Row("bending stiffness, unloaded", "N m/rad", K[1, 1], start[3]),
    ]


def _pressures(problem: Problem, found: list[Balance], done: Callable[[int], None]) -> list[Row]:
    """The four bifurcation pressures, on the frustum's own face and with the sealed end's pull."""
    rows = []
    bent = next((b for b in found if b.stable and b.point.phi_rad > 0), None)
    step = 0
    for sealed in (False, True):
        where = "end sealed" if sealed else "own face"
        try:
            low, inner_low, inner_high, high = reduced_frustum(problem, sealed=sealed).bifurcation_pressures()
        except ModelError:
            low = inner_low = inner_high = high = math.nan
        up_first = problem.profile.height_m < 0
        folded, deployed = (straight_end(problem, up_first == up, sealed) for up in (True, False))
        step += 1
        done(step)
        for name, reduced, end in (("up", high, folded), ("down", low, deployed)):
            how = "tilting" if end.tilts else "straight"
            rows.append(
                Row(f"straight state ends, {where}, {name} ({how})", "kPa", reduced / 1e3, end.pressure_pa / 1e3)
            )
        for name, reduced, upwards in (("up", inner_high, True), ("down", inner_low, False)):
            shell = bent_end(problem, bent.point, upwards, sealed)[0] / 1e3 if bent else math.nan
            rows.append(Row(f"bent state ends, {where}, {name}", "kPa", reduced / 1e3, shell))
        step += 1
        done(step)
    return rows


def printed(rows: list[Row]) -> str:
    """The rows as a table."""
    width = max(len(row.name) for row in rows)
    lines = [f"{'':<{width}}  {'reduced':>10} {'shell':>10} {'difference':>11}"]
    for row in rows:
        numbers = [f"{round(x, 9) + 0.0:.4g}" if math.isfinite(x) else "-" for x in (row.reduced, row.shell)]
        off = f"{round(row.difference, 9) + 0.0:+.3g}" if math.isfinite(row.difference) else ""
        lines.append(f"{row.name:<{width}}  {numbers[0]:>10} {numbers[1]:>10} {off:>11} {row.unit}".rstrip())
    return "\n".join(lines)
