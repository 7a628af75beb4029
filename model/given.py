"""Derivatives of a run's inputs along directions, laid out for the compiled columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.channel import channel_of
from straw.model.constants import Constants
from straw.model.direction import FRUSTA, RANGE, SCALARS, Direction, at_times, moved, small
from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.term import Frustum
from straw.model.terms import COLUMNS, TERMS, WIDTH
from straw.model.terms.shell_energy import ROW
from straw.model.terms.shell_energy import SHARE as SHARE_AT

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

R_I, R_O, RHO, GRAVITY, PHI_0, M_TIP, I_TIP, F_X, F_Z, M_Y, LOSS, AREA, C3, CYCLE = range(len(SCALARS))
#: Rows of Given.inlet, as `straw.model.channel.Channel` has them.
INLET = ("loss", "resistance", "inertance", "lag_s", "line_pa_per_m3", "gas_m3", "exponent")
#: Share of a constant's value, or of its plausible range where it is zero, by which its law's derivative moves it:
#: central differences are off by its square. What memories do in a step may be a millionth of what they hold.
SHARE, SHARE_OF_MEMORY = 1e-4, 1e-3


class Given(NamedTuple):
    """P directions. Constants of single frusta are sparse: entry e is the one of a frustum, with which columns move."""

    remembers: bool  # memories change
    in_world: bool  # forces act in the world's directions, or depend on where a body is
    odd_moves: bool  # heights of rigid odd frusta change
    scalars: Floats  # (len(SCALARS), P)
    moves: NDArray[np.bool_]  # (len(SCALARS),) whether any column moves it
    odd: Floats  # (cells, P) heights of rigid odd frusta
    cell: Indices  # (E,)
    frustum: Indices  # (E,)
    number: Indices  # (E,) of the constant in `straw.model.term.Frustum`, or 12 + its column in the row of terms
    term: Indices  # (E,) place of the term among all, -1 for none
    step: Floats  # (E,)
    start: Indices  # (E + 1,) where its columns start
    column: NDArray[np.uint64]  # not signed, as none is counted from the end: that would have to be asked each time
    value: Floats
    wall_cell: Indices  # (W,) rows of `straw.model.terms.shell_energy`: of which frustum, in which column,
    wall_frustum: Indices
    wall_column: Indices
    wall_by: Floats  # (W, ROW) which way they move,
    wall_step: Floats  # (W,) and how far is little
    body: Indices  # (B,) columns that bodies' laws see
    body_steps: Floats  # (B,)
    body_rows: Floats  # (B, WIDTH)
    body_zeta0: Floats  # (B, cells, 2)
    inlet: Floats  # (len(INLET), P)
    inlet_tables: Floats  # (P, ..) of Channel.more
    driven: Indices  # (D,) columns that the pressure's derivative moves
    drive: Floats  # (D, points) it on the pressure's grid


#: A strength with a negligible effect, but not zero.
BARELY = 1e-200

#: Of each column in a row of terms the term's place among all, and its kind.
_TERM = np.repeat(np.arange(len(TERMS)), [len(term.constants) for term in TERMS.values()])
_KIND = np.array([term.kind for term in TERMS.values()])[_TERM]


def given(straw: StrawParameters, table: Table, directions: Sequence[Direction]) -> Given:
    """Directions laid out; the pressure's on the grid of ``table``."""
    for d in directions:
        if d.cells != straw.cells:
            raise ModelError(f"derivative: {d.name} is of {d.cells} cells, the straw has {straw.cells}")
    c, wall, P = straw.constants(), _walls(straw, directions), len(directions)
    scalars = np.array([d.scalars for d in directions]).reshape(P, len(SCALARS)).T.copy()
    rigid = straw.form == "truncated"
    odd = np.array([d.frusta[0, :, 0] for d in directions]).reshape(P, straw.cells).T.copy()
    entries = _entries(straw, directions)
    keys = sorted(entries)
    where = np.array(keys, np.int64).reshape(len(keys), 3)
    pairs = [entries[key] for key in keys]
    body_terms = any(np.any(c.terms[0, 0, slice(*COLUMNS[n])][_strengths(n)]) for n in TERMS if TERMS[n].kind == "body")
    rows = np.zeros((P, WIDTH))
    for p, d in enumerate(directions):
        base = (d.where[:, 0] == 0) & (d.where[:, 1] == 0) & (_KIND[d.where[:, 2]] == "body")
        np.add.at(rows[p], d.where[base, 2], d.terms[base])
    sees = rows.any(axis=1)
    if body_terms:
        shaped = scalars[[R_I, R_O, RHO, AREA]].any(axis=0)
        sees |= shaped | np.array([bool(d.frusta[0].any()) for d in directions], bool)
    body = np.flatnonzero(sees).tolist()
    walls = [
        (p, int(i), int(j))
        for p, d in enumerate(directions)
        for i, j in np.argwhere(d.wall.any(axis=2))
        if j == 1 or not rigid
    ]
    inlet, tables = _inlet(straw, directions)
    grid = np.asarray(table.start_s + table.step_s * np.arange(len(table.pressure_pa)), np.float64)
    drives = {p: at_times(d.pressure, grid) for p, d in enumerate(directions) if d.pressure is not None}
    return Given(
        remembers=bool(c.remembers or any((_KIND[d.where[:, 2]] == "memory").any() for d in directions)),
        in_world=bool(body_terms or c.F_X != 0 or c.F_Z != 0),
        odd_moves=bool(rigid and odd.any()),
        scalars=scalars,
        moves=np.asarray(scalars.any(axis=1)),
        odd=odd if rigid else np.zeros_like(odd),
        cell=where[:, 0].copy(),
        frustum=where[:, 1].copy(),
        number=where[:, 2].copy(),
        term=np.array([_TERM[key[2] - 12] if key[2] >= 12 else -1 for key in keys], np.int64),
        step=np.array([_step(c, key) for key in keys]),
        start=np.cumsum([0, *(len(x) for x in pairs)]),
        column=np.array([p for x in pairs for p, _ in x], np.uint64),
        value=np.array([by for x in pairs for _, by in x], np.float64),
        wall_cell=np.array([i for _, i, _ in walls], np.int64),
        wall_frustum=np.array([j for _, _, j in walls], np.int64),
        wall_column=np.array([p for p, _, _ in walls], np.int64),
        wall_by=np.array([directions[p].wall[i, j] for p, i, j in walls]).reshape(len(walls), ROW),
        wall_step=np.array([_wall_step(wall[i, j], directions[p].wall[i, j]) for p, i, j in walls]),
        body=np.array(body, np.int64),
        body_steps=np.array([10 * small(c, directions[p]) for p in body]),
        body_rows=rows[np.array(body, np.int64)],
        body_zeta0=np.array([directions[p].frusta[0] for p in body]).reshape(len(body), straw.cells, 2),
        inlet=inlet,
        inlet_tables=tables,
        driven=np.array(list(drives), np.int64),
        drive=np.array(list(drives.values()), np.float64).reshape(len(drives), len(grid)),
    )


def _strengths(name: str) -> list[int]:
    return [i for i, constant in enumerate(TERMS[name].constants) if constant.name in TERMS[name].strengths]


def _entries(
    straw: StrawParameters, directions: Sequence[Direction]
) -> dict[tuple[int, int, int], list[tuple[int, float]]]:
    """By (cell, frustum, number of the constant): columns and how fast they move it. Rigid frusta feel nothing."""
    found: dict[tuple[int, int, int], list[tuple[int, float]]] = {}
    first = 0 if straw.form == "full" else 1
    for p, d in enumerate(directions):
        for kind, i, j in np.argwhere(d.frusta != 0):
            if j >= first:
                number = Frustum._fields.index(FRUSTA[kind])
                found.setdefault((int(i), int(j), number), []).append((p, float(d.frusta[kind, i, j])))
        for (i, j, k), by in zip(d.where, d.terms, strict=True):
            if j >= first and _KIND[k] in ("frustum", "memory"):
                found.setdefault((int(i), int(j), 12 + int(k)), []).append((p, float(by)))
    return found


def _step(c: Constants, key: tuple[int, int, int]) -> float:
    i, j, number = key
    if number >= 12:
        value = abs(float(c.terms[i, j, number - 12]))
        share = SHARE_OF_MEMORY if _KIND[number - 12] == "memory" else SHARE
        return share * (value or float(RANGE[number - 12]))
    value = abs(float(getattr(c, Frustum._fields[number])[i, j]))
    return SHARE * value if value else 1e-3  # a damping of zero; its force is linear in it


def _wall_step(row: Floats, by: Floats) -> float:
    """A step along a change of a row of walls that moves no length or share by more than a millionth."""
    scale = np.append(np.maximum(np.abs(row[:SHARE_AT]), 1e-12), np.full(ROW - SHARE_AT, max(1.0, np.abs(row).max())))
    return 1e-6 / float((np.abs(by) / scale).max())


def _inlet(straw: StrawParameters, directions: Sequence[Direction]) -> tuple[Floats, Floats]:
    """Derivatives of the inlet, (len(INLET), P) and (P, ..): a smooth function of constants, by central differences."""
    c = straw.constants()
    out, tables = np.zeros((len(INLET), len(directions))), np.zeros((len(directions), len(channel_of(c).more)))
    for p, d in enumerate(directions):
        if not (d.scalars[[LOSS, CYCLE]].any() or (_KIND[d.where[:, 2]] == "flow").any()):
            continue
        e = small(c, d)
        plus, minus = (channel_of(moved(c, d, sign * e)) for sign in (1, -1))
        out[:, p] = [(getattr(plus, name) - getattr(minus, name)) / (2 * e) for name in INLET]
        tables[p] = (plus.more - minus.more) / (2 * e)
    return out, tables


def _walls(straw: StrawParameters, directions: Sequence[Direction]) -> Floats:
    """Rows of the walls, those of share zero too where a direction moves them."""
    wall = straw.constants().wall
    return straw.walls() if any(d.wall[wall[:, :, 0] == 0].any() for d in directions) else wall


def linearised(straw: StrawParameters, directions: Sequence[Direction]) -> Constants:
    """The constants to linearise at, a copy that may be moved: memories and walls on which a
    direction acts are included, with a negligible strength."""
    c = straw.constants()
    alive, wall, acts = c.terms.copy(), _walls(straw, directions), c.acts.copy()
    for place, (name, (start, end)) in enumerate(COLUMNS.items()):
        if TERMS[name].kind == "memory":
            for d in directions:
                of = (d.where[:, 2] >= start) & (d.where[:, 2] < end)
                at = (d.where[of, 0], d.where[of, 1], np.full(int(of.sum()), start))
                acts[place] |= of.any()
                alive[at] = np.where(alive[at] == 0, BARELY, alive[at])
    return c._replace(
        terms=alive,
        wall=np.ascontiguousarray(wall),
        plain=not acts.any(),
        acts=acts,
        remembers=c.remembers or bool(np.any(acts != c.acts)),
    )
