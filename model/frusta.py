"""All frustum terms summed: force on each frustum's zeta and phi, and how it changes with its own motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, called, composed
from straw.model.constants import Constants
from straw.model.load import Load
from straw.model.motion import Motion
from straw.model.term import Frustum
from straw.model.terms import COLUMNS, TERMS
from straw.model.terms.damping import damping_force
from straw.model.terms.elasticity import walls_energy, walls_force

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Terms whose force is a state: a straw remembers (cells, 2, MEMORIES, 2) forces on zeta and phi.
MEMORY_TERMS = [name for name, term in TERMS.items() if term.kind == "memory"]
MEMORIES = len(MEMORY_TERMS)
#: Their places among all terms, as `Constants.acts` has them.
MEMORY_PLACES = np.array([list(TERMS).index(name) for name in MEMORY_TERMS])


def _sum_of(kind: str) -> Any:
    """One compiled function (acts, f, k) -> (force, moment) adding the memoryless terms of a kind that act."""

    @composed
    def total(acts: Bools, f: Frustum, k: Floats) -> tuple[float, float]:
        return 0.0, 0.0

    def plus(first: Callable[..., Any], force: Callable[..., Any], place: int, start: int, end: int) -> Any:
        @composed
        def both(acts: Bools, f: Frustum, k: Floats) -> tuple[float, float]:
            one = first(acts, f, k)
            if not acts[place]:
                return float(one[0]), float(one[1])
            other = force(f, k[start:end])
            return float(one[0] + other[0]), float(one[1] + other[1])

        return both

    for place, (name, term) in enumerate(TERMS.items()):
        if term.kind == kind:
            total = plus(total, term.force, place, *COLUMNS[name])
    return total


def _energy_of(kind: str) -> Any:
    """One compiled function (f, k) -> J adding the energies of all terms of a kind that have one."""

    @composed
    def total(f: Frustum, k: Floats) -> float:
        return 0.0

    def plus(first: Callable[..., Any], energy: Callable[..., Any], start: int, end: int) -> Any:
        @composed
        def both(f: Frustum, k: Floats) -> float:
            return float(first(f, k) + energy(f, k[start:end]))

        return both

    for name, term in TERMS.items():
        if term.kind == kind and term.energy is not None:
            total = plus(total, term.energy, *COLUMNS[name])
    return total


def _memory_of() -> Any:
    """One compiled function summing the terms with memory that act; ``now`` gets what each remembers after the step."""

    @composed
    def total(acts: Bools, f: Frustum, k: Floats, known: Floats, now: Floats, step_s: float) -> tuple[float, float]:
        return 0.0, 0.0

    def plus(first: Callable[..., Any], force: Callable[..., Any], start: int, end: int, at: int, place: int) -> Any:
        @composed
        def both(acts: Bools, f: Frustum, k: Floats, known: Floats, now: Floats, step_s: float) -> tuple[float, float]:
            one = first(acts, f, k, known, now, step_s)
            if not acts[place] or k[start] == 0:
                return float(one[0]), float(one[1])
            now[at, 0], now[at, 1] = force(f, k[start:end], known[at, 0], known[at, 1], step_s)
            return float(one[0] - now[at, 0]), float(one[1] - now[at, 1])

        return both

    for at, name in enumerate(MEMORY_TERMS):
        total = plus(total, TERMS[name].force, *COLUMNS[name], at, int(MEMORY_PLACES[at]))
    return total


_memoryless = _sum_of("frustum")
_with_memory = _memory_of()
_stored = _energy_of("frustum")


@allocates_nothing
def frustum_at(
    c: Constants, m: Motion, i: int, j: int, dz: float = 0.0, df: float = 0.0, dv: float = 0.0, dw: float = 0.0
) -> Frustum:
    """Frustum j (0 odd, 1 even) of cell i + 1 at a moment, its zeta, phi and their rates moved by the last four."""
    return Frustum(
        m.zeta[i, j] + dz,
        m.phi[i, j] + df,
        m.d_zeta[i, j] + dv,
        m.d_phi[i, j] + dw,
        c.zeta0[i, j],
        c.C1[i, j],
        c.C2[i, j],
        c.c_zeta[i, j],
        c.c_phi[i, j],
        c.r_i,
        c.r_o,
        c.cycle,
        c.wall[i, j],
        m.inside_pa[0],
        m.time_s[0],
    )


@called
def beyond_base_law(
    acts: Bools, f: Frustum, k: Floats, known: Floats, now: Floats, step_s: float
) -> tuple[float, float]:
    """What the terms beyond the base model add; a call, so that all laws are compiled in one place only."""
    more, memory = _memoryless(acts, f, k), _with_memory(acts, f, k, known, now, step_s)
    return more[0] + memory[0], more[1] + memory[1]


@allocates_nothing
def _beside_walls(
    c: Constants, f: Frustum, k: Floats, known: Floats, now: Floats, step_s: float
) -> tuple[float, float]:
    damping = damping_force(f)
    if c.plain:
        return damping
    more = beyond_base_law(c.acts, f, k, known, now, step_s)
    return damping[0] + more[0], damping[1] + more[1]


@allocates_nothing
def _force(c: Constants, f: Frustum, k: Floats, known: Floats, now: Floats, step_s: float) -> tuple[float, float]:
    elastic, more = walls_force(f), _beside_walls(c, f, k, known, now, step_s)
    return elastic[0] + more[0], elastic[1] + more[1]


@allocates_nothing
def add_frusta(c: Constants, m: Motion, known: Floats, now: Floats, step_s: float, load: Load) -> None:
    """Add all frustum terms after an implicit step (see `straw.model.term`); a step of zero leaves memories alone."""
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            force, moment = _force(c, frustum_at(c, m, i, j), c.terms[i, j], known[i, j], now[i, j], step_s)
            load.cell[i, j] += force
            load.cell[i, 2 + j] += moment


@allocates_nothing
def remember(c: Constants, m: Motion, known: Floats, now: Floats, step_s: float) -> None:
    """What the frusta remember after an implicit step, into ``now``."""
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            beyond_base_law(c.acts, frustum_at(c, m, i, j), c.terms[i, j], known[i, j], now[i, j], step_s)


# not `compiled`: a row of c.wall that code without reference counts has taken must not be counted down here
@allocates_nothing
def frusta_energy(c: Constants, m: Motion) -> float:
    """Energy stored in the frusta by the terms that derive from one, J."""
    total = 0.0
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            f = frustum_at(c, m, i, j)
            total += walls_energy(f) + _stored(f, c.terms[i, j])
    return total


@allocates_nothing
def tangent(c: Constants, m: Motion, known: Floats, now: Floats, step_s: float, B: Floats, K: Floats) -> None:
    """Minus the derivative of the frusta's forces by each frustum's displacement in a step, B (cells, 2, 2, 2).

    A displacement d within the step changes the rate by d / step_s. K (cells, 2, 2, 2) gets the part at held rates.
    Forward differences: an error here costs Newton iterations, never accuracy.
    """
    dz, df = 1e-8, 1e-6
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            row, past, scratch = c.terms[i, j], known[i, j], now[i, j]
            force = moment = wall = turned = 0.0
            for moved in range(5):  # in one place, as compiling all laws takes long
                dv, dw = dz / step_s if moved == 3 else 0.0, df / step_s if moved == 4 else 0.0
                f = frustum_at(c, m, i, j, dz if moved == 1 else 0.0, df if moved == 2 else 0.0, dv, dw)
                up, turn = wall, turned
                if moved < 3:  # walls feel no rates
                    up, turn = walls_force(f)
                if moved == 0:
                    wall, turned = up, turn
                more = _beside_walls(c, f, row, past, scratch, step_s)
                up, turn = up + more[0], turn + more[1]
                step = dz if moved == 1 or moved == 3 else df
                if moved == 0:
                    force, moment = up, turn
                elif moved < 3:
                    K[i, j, 0, moved - 1], K[i, j, 1, moved - 1] = (force - up) / step, (moment - turn) / step
                else:
                    B[i, j, 0, moved - 3] = K[i, j, 0, moved - 3] + (force - up) / step
                    B[i, j, 1, moved - 3] = K[i, j, 1, moved - 3] + (moment - turn) / step
