"""How the frusta's forces change with their motion and constants: central differences of each law by itself.

So the author of a law writes no derivatives. Differences of a single law, with steps that suit it, are good
to 1e-9; differences between runs are not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, called, composed
from straw.model.constants import Constants
from straw.model.frusta import MEMORIES, MEMORY_TERMS, beyond_base_law, frustum_at
from straw.model.motion import Motion
from straw.model.term import Frustum
from straw.model.terms import COLUMNS, TERMS
from straw.model.terms.elasticity import walls_force

Floats = NDArray[np.float64]


def _law() -> Any:
    """One compiled function (number, f, k, zeta, phi, step_s) -> force and moment of just one term by its number, and
    zero for numbers that are no term's; of a memory what it is after the step, from what it was before."""

    @composed
    def total(number: int, f: Frustum, k: Floats, zeta: float, phi: float, step_s: float) -> tuple[float, float]:
        return 0.0, 0.0

    def plus(first: Callable[..., Any], force: Callable[..., Any], own: int, start: int, end: int) -> Any:
        @composed
        def both(number: int, f: Frustum, k: Floats, zeta: float, phi: float, step_s: float) -> tuple[float, float]:
            if number == own:
                one = force(f, k[start:end])
                return float(one[0]), float(one[1])
            other = first(number, f, k, zeta, phi, step_s)
            return float(other[0]), float(other[1])

        return both

    def plus_memory(first: Callable[..., Any], force: Callable[..., Any], own: int, start: int, end: int) -> Any:
        @composed
        def both(number: int, f: Frustum, k: Floats, zeta: float, phi: float, step_s: float) -> tuple[float, float]:
            if number == own:
                one = force(f, k[start:end], zeta, phi, step_s)
                return float(one[0]), float(one[1])
            other = first(number, f, k, zeta, phi, step_s)
            return float(other[0]), float(other[1])

        return both

    for own, (name, term) in enumerate(TERMS.items()):
        if term.kind in ("frustum", "memory"):
            total = (plus if term.kind == "frustum" else plus_memory)(total, term.force, own, *COLUMNS[name])
    return total


_one_law = _law()


@called
def law_of(number: int, f: Frustum, k: Floats, zeta: float, phi: float, step_s: float) -> tuple[float, float]:
    """Force and moment of just one term, by its place among all terms, or what it remembers; see `_law`."""
    force, moment = _one_law(number, f, k, zeta, phi, step_s)
    return force, moment


#: Of each term its place among those with memory, -1 for one without.
MEMORY_OF = np.array([MEMORY_TERMS.index(name) if name in MEMORY_TERMS else -1 for name in TERMS])

#: Steps of the derivatives of the frusta's laws by zeta (m), phi (rad) and their rates: with central differences off by
#: some 1e-9 of the law, as laws change over 5 um and more.
LAW_STEPS = (1e-8, 1e-6, 1e-7, 1e-5)
#: The pressure inside, in place of a constant's number, and its step, Pa.
PRESSURE, PRESSURE_STEP_PA = -1, 1.0


@allocates_nothing
def _with_constant(f: Frustum, field: int, more: float) -> Frustum:
    """A frustum with one of the constants it carries moved, numbered as `straw.model.term.Frustum` has them."""
    return Frustum(
        f.zeta,
        f.phi,
        f.d_zeta,
        f.d_phi,
        f.zeta0 + (more if field == 4 else 0.0),
        f.C1 + (more if field == 5 else 0.0),
        f.C2 + (more if field == 6 else 0.0),
        f.c_zeta + (more if field == 7 else 0.0),
        f.c_phi + (more if field == 8 else 0.0),
        f.r_i + (more if field == 9 else 0.0),
        f.r_o + (more if field == 10 else 0.0),
        f.cycle + (more if field == 11 else 0.0),
        f.wall,
        f.pressure + (more if field == PRESSURE else 0.0),
        f.time_s,
    )


@allocates_nothing
def base_force(c: Constants, m: Motion, i: int, j: int, number: int, more: float) -> tuple[float, float]:
    """What the walls do to a frustum with one of its numbers moved: a state (0, 1) or a constant (4, 5, 6, 9)."""
    f = frustum_at(c, m, i, j, more if number == 0 else 0.0, more if number == 1 else 0.0)
    return walls_force(_with_constant(f, number, more))


@allocates_nothing
def by_wall(c: Constants, m: Motion, i: int, j: int, way: Floats, e: float, row: Floats) -> tuple[float, float]:
    """Derivative of a frustum's force and moment: its row of `straw.model.terms.shell_energy` moves along ``way``."""
    f = frustum_at(c, m, i, j)
    force, moment = 0.0, 0.0
    for sign in (1.0, -1.0):
        for x in range(len(row)):
            row[x] = f.wall[x] + sign * e * way[x]
        one = walls_force(
            Frustum(
                f.zeta,
                f.phi,
                f.d_zeta,
                f.d_phi,
                f.zeta0,
                f.C1,
                f.C2,
                f.c_zeta,
                f.c_phi,
                f.r_i,
                f.r_o,
                f.cycle,
                row,
                f.pressure,
                f.time_s,
            )
        )
        force += sign * one[0] / (2 * e)
        moment += sign * one[1] / (2 * e)
    return force, moment


@allocates_nothing
def beyond_base(
    c: Constants, m: Motion, i: int, j: int, number: int, more: float, known: Floats, now: Floats, step_s: float
) -> tuple[float, float]:
    """What terms beyond the base model do to a frustum with one number moved, see `straw.model.term.Frustum`."""
    f = frustum_at(
        c,
        m,
        i,
        j,
        more if number == 0 else 0.0,
        more if number == 1 else 0.0,
        more if number == 2 else 0.0,
        more if number == 3 else 0.0,
    )
    return beyond_base_law(c.acts, _with_constant(f, number, more), c.terms[i, j], known, now, step_s)


@allocates_nothing
def frusta_slopes(
    c: Constants, m: Motion, known: Floats, scratch: Floats, step_s: float, by: Floats, memory_by: Floats
) -> None:
    """Derivatives of each frustum's force and moment by its zeta, phi and their rates, into by (cells, 2, 2, 4).

    memory_by (cells, 2, MEMORIES, 2, 7) gets those of what each remembers after the step, by these four and by the
    two values known before; the last, by the pressure, is that of `straw.model.given_loads.add_per_pascal`.
    ``scratch`` (2, MEMORIES, 2). Damping is linear, its slope written.
    """
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            own = by[i, j]
            for x in range(2):
                e = LAW_STEPS[x]
                (f, g), (f2, g2) = (base_force(c, m, i, j, x, e), base_force(c, m, i, j, x, -e))
                own[0, x], own[1, x] = (f - f2) / (2 * e), (g - g2) / (2 * e)
            own[0, 2], own[1, 2], own[0, 3], own[1, 3] = -c.c_zeta[i, j], 0.0, 0.0, -c.c_phi[i, j]
            if c.plain:
                continue
            up, down = scratch[0], scratch[1]
            for x in range(4):
                e = LAW_STEPS[x]
                f, g = beyond_base(c, m, i, j, x, e, known[i, j], up, step_s)
                f2, g2 = beyond_base(c, m, i, j, x, -e, known[i, j], down, step_s)
                own[0, x] += (f - f2) / (2 * e)
                own[1, x] += (g - g2) / (2 * e)
                if c.remembers:
                    for at in range(MEMORIES):
                        for y in range(2):
                            memory_by[i, j, at, y, x] = (up[at, y] - down[at, y]) / (2 * e)
            if c.remembers:
                _by_known(c, m, i, j, known[i, j], up, down, step_s, memory_by[i, j])


@allocates_nothing
def _by_known(
    c: Constants, m: Motion, i: int, j: int, known: Floats, up: Floats, down: Floats, step_s: float, by: Floats
) -> None:
    """Derivatives of what a frustum remembers after a step by what it did before, into by (MEMORIES, 2, 7) from 4."""
    for y in range(2):
        e = 1e-3 if y == 0 else 1e-5
        for at in range(MEMORIES):
            before = known[at, y]
            known[at, y] = before + e
            beyond_base(c, m, i, j, 12, 0.0, known, up, step_s)
            known[at, y] = before - e
            beyond_base(c, m, i, j, 12, 0.0, known, down, step_s)
            known[at, y] = before
            for z in range(2):
                by[at, z, 4 + y] = (up[at, z] - down[at, z]) / (2 * e)
