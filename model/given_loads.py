"""Derivatives of a stage's loads along the directions at fixed motion, constant by constant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Bench, add
from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.frusta import MEMORIES, frustum_at
from straw.model.frusta_slopes import (
    MEMORY_OF,
    PRESSURE,
    PRESSURE_STEP_PA,
    base_force,
    beyond_base,
    by_wall,
    law_of,
)
from straw.model.given import AREA, C3, CYCLE, F_X, F_Z, GRAVITY, I_TIP, M_TIP, M_Y, PHI_0, R_I, R_O, RHO, Given
from straw.model.links import ANGLE, AX, AZ, D_SPIN, own_loads
from straw.model.stages import Stages
from straw.model.sweeps import Rows

Floats = NDArray[np.float64]


@allocates_nothing
def _moved(c: Constants, number: int, more: float) -> Constants:
    """The constants with a radius or the area of a frustum's volume moved."""
    return Constants(
        c.cells,
        c.active,
        c.r_i + (more if number == R_I else 0.0),
        c.r_o + (more if number == R_O else 0.0),
        c.rho,
        c.g,
        c.phi_0,
        c.m_tip,
        c.I_tip,
        c.F_X,
        c.F_Z,
        c.M_Y,
        c.loss,
        c.S + (more if number == AREA else 0.0),
        c.C3,
        c.zeta0,
        c.C1,
        c.C2,
        c.wall,
        c.c_zeta,
        c.c_phi,
        c.cycle,
        c.start_s,
        c.plain,
        c.acts,
        c.remembers,
        c.terms,
    )


@allocates_nothing
def add_given(c: Constants, given: Given, s: Stages, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """Add to the block the derivatives of the loads along the directions at fixed motion, constant by constant."""
    _of_bodies(c, given, b, rows)
    _of_all_frusta(c, given, s, stage, hg, b, rows)
    _of_ends(c, given, s.inside_pa[stage], b, rows)
    _of_frusta(c, given, s, stage, hg, b, rows)
    _of_walls(c, given, b, rows)


@allocates_nothing
def _of_bodies(c: Constants, given: Given, b: Bench, rows: Rows) -> None:
    """By what gives the cells' bodies their mass and shape."""
    block, links, ends, n, k = b.sweeps.block, b.links, b.ends, c.cells, 2 * c.active
    if given.moves[RHO] and not given.in_world:  # to which the load of a body is proportional,
        for i in range(n):
            for x in range(3):
                add(links.wrench[i, x] / c.rho, given.scalars[RHO], block[i, x])
            for x in range(k):
                add(links.force[i, x] / c.rho, given.scalars[RHO], block[i, rows.force + x])
    elif given.moves[RHO]:  # but for what the world does to it
        own_loads(c, b.motion, b.unpushed, links, ends[0])
        for i in range(n):
            for x in range(3):
                add(ends[0, i, x] / c.rho, given.scalars[RHO], block[i, x])
            for x in range(k):
                add(ends[0, i, 3 + links.slots[x]] / c.rho, given.scalars[RHO], block[i, rows.force + x])
    for number in (R_I, R_O, AREA):
        row = given.scalars[number]
        if given.moves[number]:
            value = c.r_i if number == R_I else c.r_o if number == R_O else c.S
            e = 1e-6 * value
            own_loads(_moved(c, number, e), b.motion, b.pushed, links, ends[0])
            own_loads(_moved(c, number, -e), b.motion, b.pushed, links, ends[1])
            for i in range(n):
                for x in range(3):
                    add((ends[0, i, x] - ends[1, i, x]) / (2 * e), row, block[i, x])
                for x in range(k):
                    at = 3 + links.slots[x]
                    add((ends[0, i, at] - ends[1, i, at]) / (2 * e), row, block[i, rows.force + x])


@allocates_nothing
def _of_all_frusta(c: Constants, given: Given, s: Stages, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """By what all frusta share."""
    block, n = b.sweeps.block, c.cells
    for number in (R_I, R_O, CYCLE):
        row = given.scalars[number]
        if given.moves[number]:
            e = 1e-6 * (c.r_i if number == R_I else c.r_o if number == R_O else max(c.cycle, 1.0))
            field = 9 if number == R_I else 10 if number == R_O else 11
            for i in range(n):
                for j in range(2 - c.active, 2):
                    force, moment = _by_number(c, s, stage, i, j, field, e, hg, b)
                    add(force, row, block[i, rows.force + j - 2 + c.active])
                    add(moment, row, block[i, rows.force + j - 2 + 2 * c.active])
                    if c.remembers:
                        for at in range(MEMORIES):
                            for y in range(2):
                                add(b.remembering[2, at, y], row, b.now_memory[i, j, at, y])


@allocates_nothing
def add_per_pascal(c: Constants, s: Stages, stage: int, hg: float, b: Bench, rows: Rows, P: int) -> None:
    """Add to the block, in column P behind all others, what a pascal inside changes of the frusta's laws."""
    block, e, up, down = b.sweeps.block, PRESSURE_STEP_PA, b.remembering[0], b.remembering[1]
    for i in range(c.cells):
        for j in range(2 - c.active, 2):
            known = s.known_memory[stage, i, j]
            force, moment = beyond_base(c, b.motion, i, j, PRESSURE, e, known, up, hg)
            less, turned = beyond_base(c, b.motion, i, j, PRESSURE, -e, known, down, hg)
            block[i, rows.force + j - 2 + c.active, P] += (force - less) / (2 * e)
            block[i, rows.force + j - 2 + 2 * c.active, P] += (moment - turned) / (2 * e)
            if c.remembers:
                for at in range(MEMORIES):
                    for y in range(2):
                        b.memory_by[i, j, at, y, 6] = (up[at, y] - down[at, y]) / (2 * e)


@allocates_nothing
def _of_ends(c: Constants, given: Given, inside_pa: float, b: Bench, rows: Rows) -> None:
    """By what acts at the base and at the tip, and by how the pressure does."""
    block, links, n = b.sweeps.block, b.links, c.cells
    tip, wrench = links.joint[n], block[n - 1]
    ux, uz = links.axis[n, 0], links.axis[n, 1]
    if given.moves[R_I]:
        add(2 * math.pi * c.r_i * inside_pa * ux, given.scalars[R_I], wrench[rows.beyond])
        add(2 * math.pi * c.r_i * inside_pa * uz, given.scalars[R_I], wrench[rows.beyond + 1])
    if given.moves[M_TIP]:
        add(-tip[AX], given.scalars[M_TIP], wrench[rows.beyond])
        add(-tip[AZ], given.scalars[M_TIP], wrench[rows.beyond + 1])
    if given.moves[I_TIP]:
        add(-tip[D_SPIN], given.scalars[I_TIP], wrench[rows.beyond + 2])
    for x, number in enumerate((F_X, F_Z, M_Y)):
        if given.moves[number]:
            add(1.0, given.scalars[number], wrench[rows.beyond + x])
    if given.moves[GRAVITY]:
        add(1.0, given.scalars[GRAVITY], block[0, rows.joint + AZ])
    if given.moves[PHI_0]:
        add(-c.g, given.scalars[PHI_0], block[0, rows.joint + AX])
        if given.in_world:
            add(1.0, given.scalars[PHI_0], block[0, rows.joint + ANGLE])
    if given.moves[C3]:
        for i in range(n):
            for x in range(c.active):
                add(inside_pa, given.scalars[C3], block[i, rows.force + x])


@allocates_nothing
def _of_frusta(c: Constants, given: Given, s: Stages, stage: int, hg: float, b: Bench, rows: Rows) -> None:
    """By constants of single frusta."""
    block = b.sweeps.block
    for entry in range(len(given.cell)):
        i, j, number, e = given.cell[entry], given.frustum[entry], given.number[entry], given.step[entry]
        memory = -1 if number < 12 else MEMORY_OF[given.term[entry]]
        if number < 12:
            force, moment = _by_number(c, s, stage, i, j, number, e, hg, b)
        else:
            force, moment = _by_constant(c, s, stage, i, j, number - 12, given.term[entry], memory, e, hg, b)
        for at in range(given.start[entry], given.start[entry + 1]):
            p, by = given.column[at], given.value[at]
            block[i, rows.force + j - 2 + c.active, p] += force * by
            block[i, rows.force + j - 2 + 2 * c.active, p] += moment * by
            if memory >= 0:
                b.now_memory[i, j, memory, 0, p] -= force * by
                b.now_memory[i, j, memory, 1, p] -= moment * by
            elif c.remembers and number < 12:
                for x in range(MEMORIES):
                    for y in range(2):
                        b.now_memory[i, j, x, y, p] += b.remembering[2, x, y] * by


@allocates_nothing
def _of_walls(c: Constants, given: Given, b: Bench, rows: Rows) -> None:
    """By the energies of walls that are none of equation 7."""
    for at in range(len(given.wall_cell)):
        i, j, p = given.wall_cell[at], given.wall_frustum[at], given.wall_column[at]
        force, moment = by_wall(c, b.motion, i, j, given.wall_by[at], given.wall_step[at], b.wall)
        b.sweeps.block[i, rows.force + j - 2 + c.active, p] += force
        b.sweeps.block[i, rows.force + j - 2 + 2 * c.active, p] += moment


@allocates_nothing
def _by_constant(
    c: Constants, s: Stages, stage: int, i: int, j: int, at: int, term: int, memory: int, e: float, hg: float, b: Bench
) -> tuple[float, float]:
    """Derivative of a frustum's force and moment by a constant of a term, whose law alone is asked."""
    k, f = c.terms[i, j], frustum_at(c, b.motion, i, j)
    over = 0.5 / e if memory < 0 else -0.5 / e  # a memory is minus the force
    zeta = phi = 0.0
    if memory >= 0:
        zeta, phi = s.known_memory[stage, i, j, memory, 0], s.known_memory[stage, i, j, memory, 1]
    held = k[at]
    k[at] = held + e
    force, moment = law_of(term, f, k, zeta, phi, hg)
    k[at] = held - e
    force2, moment2 = law_of(term, f, k, zeta, phi, hg)
    k[at] = held
    return (force - force2) * over, (moment - moment2) * over


@allocates_nothing
def _by_number(
    c: Constants, s: Stages, stage: int, i: int, j: int, number: int, e: float, hg: float, b: Bench
) -> tuple[float, float]:
    """Derivative of a frustum's force and moment by a constant that all laws see; of its memories: remembering[2]."""
    force, moment = 0.0, 0.0
    if number == 7:
        force = -b.motion.d_zeta[i, j]
    elif number == 8:
        moment = -b.motion.d_phi[i, j]
    else:
        f, g = base_force(c, b.motion, i, j, number, e)
        f2, g2 = base_force(c, b.motion, i, j, number, -e)
        over = 0.5 / e
        force, moment = (f - f2) * over, (g - g2) * over
    if c.plain:
        return force, moment
    up, down, known = b.remembering[0], b.remembering[1], s.known_memory[stage, i, j]
    f, g = beyond_base(c, b.motion, i, j, number, e, known, up, hg)
    f2, g2 = beyond_base(c, b.motion, i, j, number, -e, known, down, hg)
    if c.remembers:
        for at in range(MEMORIES):
            for y in range(2):
                b.remembering[2, at, y] = (up[at, y] - down[at, y]) / (2 * e)
    return force + (f - f2) / (2 * e), moment + (g - g2) / (2 * e)
