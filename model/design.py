"""Designing: geometries that snap at wanted pressures, have wanted lengths and states, by the reduced model.

A sweep of the ranges by Sobol points, then least squares from the best; the pressures are those of a frustum whose
end is sealed (`straw.model.frusta`'s closed form), without gravity. Cells that snap in an order are tuned one by
one in the whole straw, with gravity, by their thickness.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.stats import qmc

from straw.model.errors import ModelError
from straw.model.frustum_table import frustum_of
from straw.model.parameters import Floats, StrawParameters
from straw.model.snap import snaps
from straw.model.wish import WANTED, Wish

CHUNK = 512
#: Tolerance of a tuned snap, Pa, and the most rounds it may take.
NEAR_PA, ROUNDS = 20.0, 12


@dataclass(frozen=True)
class Design:
    """A geometry: what was varied, its properties (as in `WANTED`), and their distance from the wish."""

    varied: Mapping[str, float]
    gives: Mapping[str, float]
    cost: float


def with_varied(straw: StrawParameters, varied: Mapping[str, float]) -> StrawParameters:
    """The straw with what is varied, alike in all cells; ModelError where that is no straw."""
    odd, even = straw.zeta0_m[0]
    return straw.replace(
        r_i_m=varied.get("r_i_mm", 1e3 * straw.r_i_m) * 1e-3,
        r_o_m=varied.get("r_o_mm", 1e3 * straw.r_o_m) * 1e-3,
        zeta0_m=np.array([varied.get("zeta01_mm", 1e3 * odd), varied.get("zeta02_mm", 1e3 * even)]) * 1e-3,
        h_m=np.array(varied["h_mm"] * 1e-3) if "h_mm" in varied else straw.h_m,
        E_pa=np.array(varied["E_gpa"] * 1e9) if "E_gpa" in varied else straw.E_pa,
    )


def gives(straw: StrawParameters) -> dict[str, float]:
    """Properties of a cell of the straw, as in `WANTED`; NaN where it has one state only."""
    frustum = frustum_of(straw, sealed=True)
    odd, even = (1e3 * float(x) for x in straw.zeta0_m[0])
    found = frustum.equilibria()
    stable = [e for e in found if e.stable]
    top = max((e.zeta_m for e in stable if e.phi_rad == 0), default=math.nan)
    try:
        low, _, _, high = frustum.bifurcation_pressures()
    except ModelError:
        low = high = math.nan
    return {
        "deploy_kpa": high / 1e3,
        "fold_kpa": low / 1e3,
        "folded_length_mm": odd + even,
        "deployed_length_mm": odd + 1e3 * top if top > 0 else math.nan,
        "stable_states": float(len(stable)),
    }


def _off(wish: Wish, given: Mapping[str, float]) -> Floats:
    """Differences from what is wanted in units of the accuracy; large where there is no number."""
    off = np.array([(given[k] - want) / WANTED[k] for k, want in wish.wanted.items()])
    return np.where(np.isfinite(off), off, 1e3)


def swept(wish: Wish, straw: StrawParameters, points: Floats) -> list[Design]:
    """Designs at points (n, varied); plain data in and out, so that it can run anywhere."""
    made = []
    for point in points:
        varied = dict(zip(wish.vary, point.tolist(), strict=True))
        try:
            given = gives(with_varied(straw, varied))
        except ModelError:
            continue
        made.append(Design(varied, given, float(np.sum(_off(wish, given) ** 2))))
    return made


def sweep(wish: Wish, straw: StrawParameters, count: int, executor: Executor | None = None) -> Iterator[list[Design]]:
    """Designs over the ranges, chunk by chunk."""
    low, high = np.array(list(wish.vary.values())).T
    unit = qmc.Sobol(len(low), seed=1).random_base2(max(1, math.ceil(math.log2(count))))[:count]
    points = low + unit * (high - low)
    chunks = [points[i : i + CHUNK] for i in range(0, len(points), CHUNK)]
    if executor is None:
        yield from (swept(wish, straw, chunk) for chunk in chunks)
        return
    futures = [executor.submit(swept, wish, straw, chunk) for chunk in chunks]
    for future in futures:
        yield future.result()


def refined(wish: Wish, straw: StrawParameters, designs: Sequence[Design], keep: int = 5) -> list[Design]:
    """The best designs, each refined as far as possible, without duplicates."""
    low, high = np.array(list(wish.vary.values())).T

    def at(unit: Floats) -> Floats:
        try:
            return _off(wish, gives(with_varied(straw, dict(zip(wish.vary, low + unit * (high - low), strict=True)))))
        except ModelError:
            return np.full(len(wish.wanted), 1e3)

    found: list[Design] = []
    for design in sorted(designs, key=lambda d: d.cost)[: 4 * keep]:
        start = (np.array(list(design.varied.values())) - low) / (high - low)
        best = least_squares(at, start, bounds=(0, 1), x_scale=0.1, diff_step=[1e-4] * len(start))
        other = swept(wish, straw, (low + best.x * (high - low))[None])
        if not other:
            continue
        alike = any(
            max(abs(other[0].varied[k] - d.varied[k]) / (wish.vary[k][1] - wish.vary[k][0]) for k in wish.vary) < 0.05
            for d in found
        )
        if not alike:
            found.append(other[0])
        if len(found) == keep:
            break
    return sorted(found, key=lambda d: d.cost)


def in_order(wish: Wish, straw: StrawParameters) -> tuple[StrawParameters, list[tuple[int, float]]]:
    """The straw with its cells' even frusta so thick that they snap in the order, and (cell, Pa) as they then do.

    Each cell's snap in the whole straw under gravity is brought to its own pressure by the thickness, along the closed
    form's slope. Raises ModelError where a cell cannot be brought there.
    """
    if sorted(wish.order) != list(range(1, straw.cells + 1)):
        listed = ", ".join(map(str, wish.order))
        raise ModelError(
            f"design: order.cells = {listed}; a straw of {straw.cells} cells needs each of 1 to {straw.cells} once"
        )
    sign = 1 if wish.first_kpa > 0 else -1
    deployed: list[int] = [] if sign > 0 else list(wish.order)
    targets = {cell: 1e3 * (wish.first_kpa + k * wish.apart_kpa) for k, cell in enumerate(wish.order)}
    h = straw.h_m.copy()
    aim = dict(targets)
    for cell in wish.order:
        h[cell - 1, 1] = _thickness(straw, cell, targets[cell])
    seen: list[tuple[int, float]] = []
    for _ in range(ROUNDS):
        tuned = straw.replace(h_m=h)
        seen = [(s.cell, s.pressure_pa) for s in snaps(tuned, deployed, 2 * targets[wish.order[-1]])]
        off = {cell: targets[cell] - p for cell, p in seen}
        if [c for c, _ in seen] == list(wish.order) and max(map(abs, off.values())) < NEAR_PA:
            return tuned, seen
        for cell in wish.order:
            aim[cell] += off.get(cell, 0.0)
            h[cell - 1, 1] = _thickness(straw, cell, aim[cell])
    raise ModelError(
        f"design: the cells snap as {', '.join(f'{c} at {p / 1e3:.2f}' for c, p in seen)} kPa at best; ask for "
        "pressures further apart or other ones"
    )


def _thickness(straw: StrawParameters, cell: int, pressure_pa: float) -> float:
    """Thickness at which the cell's sealed even frustum snaps at a pressure by the closed form; ModelError if none."""
    which = 3 if pressure_pa > 0 else 0
    own, h0 = frustum_of(straw, cell, sealed=True), float(straw.h_m[cell - 1, 1])

    def at(h: float) -> float:
        share = h / h0
        made = replace(own, C1=own.C1 * share, C2=own.C2 * share**3)
        try:
            return made.bifurcation_pressures()[which] - pressure_pa
        except ModelError:
            return math.nan

    grid = h0 * np.geomspace(0.2, 2.5, 60)
    values = np.array([at(float(x)) for x in grid])
    for i in range(len(grid) - 1):
        if values[i] * values[i + 1] <= 0:
            return float(brentq(at, float(grid[i]), float(grid[i + 1]), xtol=1e-12))
    raise ModelError(
        f"design: no thickness lets cell {cell} snap at {pressure_pa / 1e3:.4g} kPa; ask for another pressure"
    )
