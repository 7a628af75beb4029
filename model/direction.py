"""A direction: which way a straw's constants, the pressure that drives it and its start change, by one parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from straw.model.constants import Constants
from straw.model.drive import Table
from straw.model.elasticity import EQUATION_7
from straw.model.errors import ModelError
from straw.model.parameters import PER_FRUSTUM, StrawParameters
from straw.model.terms import COLUMNS, TERMS
from straw.model.terms.shell_energy import ROW
from straw.model.terms.shell_energy import SHARE as SHARE_AT

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Drive = Callable[[Floats], Floats] | Table

#: Numbers of `Constants` that there is one of, and those each frustum has its own of.
SCALARS = ("r_i", "r_o", "rho", "g", "phi_0", "m_tip", "I_tip", "F_X", "F_Z", "M_Y", "loss", "S", "C3", "cycle")
FRUSTA = ("zeta0", "C1", "C2", "c_zeta", "c_phi")
#: Share of a constant by which it is moved where others of `Constants` follow from it: off by 1e-10 of the derivative.
SHARE = 3e-6
#: Half the step of a delay's derivative, s; less than the grid that pressures are read on.
LATER_S = 1e-5
#: Largest plausible size of each constant of the terms.
RANGE = np.array([max(abs(c.low), abs(c.high)) for term in TERMS.values() for c in term.constants])
NUMBERS = {"r_i_m", "r_o_m", "r_ch_m", "m_tip_kg", "I_tip_kg_m2", "rho_kg_per_m3", "g_m_per_s2", "phi_0_rad"}
NUMBERS |= {"F_X_n", "F_Z_n", "M_Y_n_m", "cycle", *PER_FRUSTUM}


@dataclass(frozen=True)
class Direction:
    """Derivatives of all that a simulation starts from by one parameter, SI by the parameter's unit.

    Directions of the same straw add up and scale: ``2 * a + b``. Plain data unless ``pressure`` is a function.
    """

    cells: int
    scalars: Floats  # (len(SCALARS),)
    frusta: Floats  # (len(FRUSTA), cells, 2)
    wall: Floats  # (cells, 2, ROW), see `straw.model.terms.shell_energy`
    where: Indices = field(default_factory=lambda: np.empty((0, 3), np.int64))  # (k, 3) cell, frustum, column of terms
    terms: Floats = field(default_factory=lambda: np.empty(0))  # (k,)
    pressure: Drive | None = None  # external pressure, by time
    start: Floats | None = None  # (coordinates,), beside what the rest state does by itself
    name: str = ""

    @classmethod
    def none(cls, straw: StrawParameters) -> Self:
        """The direction in which nothing changes."""
        frusta = np.zeros((len(FRUSTA), straw.cells, 2))
        return cls(straw.cells, np.zeros(len(SCALARS)), frusta, np.zeros((straw.cells, 2, ROW)))

    @classmethod
    def of(cls, straw: StrawParameters, name: str, *, cell: int | None = None, frustum: str | None = None) -> Self:
        """By one constant, named as in a straw file (``E_pa``, ``terms.cohesion.force_n``).

        Of all frusta together, or of one ``cell`` (from 1), of its "odd" or "even" ``frustum``, or both.
        Raises ModelError for a constant, cell or frustum that the straw does not have.
        """
        mask = _mask(straw, name, cell, frustum)
        if name.startswith("terms."):
            return replace(cls._of_term(straw, name, mask), name=name)
        if name not in NUMBERS:
            raise ModelError(f"derivative: unknown constant {name!r}; known: {', '.join(sorted(NUMBERS))}, terms.*.*")
        if name not in PER_FRUSTUM and not mask.all():
            raise ModelError(f"derivative: {name} is one number for the whole straw; leave out cell and frustum")
        none, value = cls.none(straw), getattr(straw, name)
        if name in ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad"):  # which may be zero, and not below
            none.frusta[FRUSTA.index("c_zeta" if "zeta" in name else "c_phi")] = mask
            return replace(none, name=name)
        if name == "cycle":
            none.scalars[SCALARS.index("cycle")] = 1.0
            return replace(none, name=name)
        if name in PER_FRUSTUM:  # of which each frustum's constants take only their own
            a, b = (straw.replace(**{name: value * (1 + sign * SHARE)}).constants() for sign in (-1, 1))
            for row, which in enumerate(FRUSTA):
                none.frusta[row] = (getattr(b, which) - getattr(a, which)) / (2 * SHARE * value) * mask
            none.wall[:] = (b.wall - a.wall) / (2 * SHARE * value[:, :, np.newaxis]) * mask[:, :, np.newaxis]
            return replace(none, name=name)
        step = SHARE * (abs(value) or 1.0)
        minus, plus = (straw.replace(**{name: value + sign * step}) for sign in (-1, 1))
        return replace(cls.between(minus, plus, 2 * step), name=name)

    @classmethod
    def _of_term(cls, straw: StrawParameters, name: str, mask: NDArray[np.bool_]) -> Self:
        term, constant = (*name.split(".", 2)[1:], "")[:2]
        known = [c.name for c in TERMS[term].constants] if term in TERMS else []
        if constant not in known:
            raise ModelError(f"derivative: unknown constant {name}; known: {', '.join(known or TERMS)}")
        if TERMS[term].kind in ("body", "flow") and not mask.all():
            raise ModelError(f"derivative: {name} is one number for the whole straw; leave out cell and frustum")
        none = cls.none(straw)
        if TERMS[term].kind == "walls":  # of the way from what the straw file names to the other
            none.wall[:, 1, SHARE_AT] = mask[:, 1] if straw.elasticity == EQUATION_7 else -1.0 * mask[:, 1]
            return none
        at = np.argwhere(mask)
        column = np.full((len(at), 1), COLUMNS[term][0] + known.index(constant))
        return replace(none, where=np.hstack([at, column]).astype(np.int64), terms=np.ones(len(at)))

    @classmethod
    def between(cls, minus: StrawParameters, plus: StrawParameters, step: float) -> Self:
        """From one straw to another ``step`` away in a parameter of yours: any smooth change of any constants.

        A central difference of the constants, not of simulations: make ``step`` so small that they change linearly.
        """
        if (minus.cells, minus.form) != (plus.cells, plus.form):
            raise ModelError("derivative: the straws differ in cells or form, which do not change smoothly")
        a, b = minus.constants(), plus.constants()
        scalars = np.array([(getattr(b, name) - getattr(a, name)) / step for name in SCALARS])
        frusta = np.array([(getattr(b, name) - getattr(a, name)) / step for name in FRUSTA])
        change = (b.terms - a.terms) / step
        where = np.argwhere(change != 0).astype(np.int64)
        walls = [a.wall, b.wall]
        if np.any((a.wall[:, :, 0] == 0) != (b.wall[:, :, 0] == 0)):  # a share that begins or ends between them
            walls = [minus.walls(), plus.walls()]
        wall = (walls[1] - walls[0]) / step
        return cls(minus.cells, scalars, frusta, wall, where, change[tuple(where.T)], name="between")

    @classmethod
    def driven(cls, straw: StrawParameters, pressure: Drive, name: str = "pressure") -> Self:
        """By a parameter of the external pressure: its derivative by that, Pa by the parameter's unit, over time."""
        return replace(cls.none(straw), pressure=pressure, name=name)

    @classmethod
    def delay(cls, straw: StrawParameters, pressure: Callable[[Floats], Floats]) -> Self:
        """By a delay of the pressure, s."""

        def later(time_s: Floats) -> Floats:
            return (np.asarray(pressure(time_s - LATER_S)) - np.asarray(pressure(time_s + LATER_S))) / (2 * LATER_S)

        return cls.driven(straw, later, "delay_s")

    @classmethod
    def started(cls, straw: StrawParameters, start: Floats) -> Self:
        """By the start: derivatives of its coordinates, (coordinates,), added to those of the rest state."""
        start = np.asarray(start, dtype=np.float64)
        if start.shape != (straw.coordinates,):
            raise ModelError(f"derivative: a start of shape {start.shape}; expected ({straw.coordinates},)")
        return replace(cls.none(straw), start=start, name="start")

    def __add__(self, other: Self) -> Self:
        both = [x for x in (self.pressure, other.pressure) if x is not None]
        starts = [x for x in (self.start, other.start) if x is not None]
        return replace(
            self,
            scalars=self.scalars + other.scalars,
            frusta=self.frusta + other.frusta,
            wall=self.wall + other.wall,
            where=np.vstack([self.where, other.where]),
            terms=np.append(self.terms, other.terms),
            pressure=_added(*both) if len(both) == 2 else both[0] if both else None,
            start=np.sum(starts, axis=0) if starts else None,
            name=f"{self.name} + {other.name}",
        )

    def __mul__(self, factor: float) -> Self:
        drive = self.pressure
        return replace(
            self,
            scalars=self.scalars * factor,
            frusta=self.frusta * factor,
            wall=self.wall * factor,
            terms=self.terms * factor,
            pressure=None if drive is None else _scaled(drive, factor),
            start=None if self.start is None else self.start * factor,
        )

    __rmul__ = __mul__


def _scaled(drive: Drive, factor: float) -> Drive:
    if isinstance(drive, Table):
        return drive._replace(pressure_pa=drive.pressure_pa * factor)
    return lambda time_s: factor * np.asarray(drive(time_s))


def at_times(drive: Drive, time_s: Floats) -> Floats:
    """The pressure's derivative at times, Pa by the parameter's unit."""
    if isinstance(drive, Table):
        grid = drive.start_s + drive.step_s * np.arange(len(drive.pressure_pa))
        return np.interp(time_s, grid, drive.pressure_pa)
    return np.asarray(np.broadcast_to(drive(time_s), time_s.shape), dtype=np.float64)


def _added(one: Drive, other: Drive) -> Callable[[Floats], Floats]:
    return lambda time_s: at_times(one, time_s) + at_times(other, time_s)


def _mask(straw: StrawParameters, name: str, cell: int | None, frustum: str | None) -> NDArray[np.bool_]:
    """Frusta that are meant, (cells, 2)."""
    if cell is not None and not 1 <= cell <= straw.cells:
        raise ModelError(f"derivative: {name} of cell {cell}, which is not in a straw of {straw.cells} cells")
    if frustum not in (None, "odd", "even"):
        raise ModelError(f"derivative: {name} of frustum {frustum!r}; expected odd or even")
    mask = np.zeros((straw.cells, 2), bool)
    mask[slice(None) if cell is None else cell - 1, slice(None) if frustum is None else int(frustum == "even")] = True
    return mask


def moved(c: Constants, direction: Direction, step: float) -> Constants:
    """The constants ``step`` along a direction, all terms taken to act."""
    terms = c.terms.copy()
    np.add.at(terms, tuple(direction.where.T), step * direction.terms)
    frusta = {name: getattr(c, name) + step * by for name, by in zip(FRUSTA, direction.frusta, strict=True)}
    for name, array in frusta.items():  # one that may be written to is another type, for which all is compiled again
        array.setflags(write=getattr(c, name).flags.writeable)
    scalars = {name: getattr(c, name) + step * by for name, by in zip(SCALARS, direction.scalars.tolist(), strict=True)}
    return c._replace(**scalars, **frusta, terms=terms, plain=False, acts=np.ones_like(c.acts))


def small(c: Constants, direction: Direction) -> float:
    """A step along a direction that moves no constant by more than a millionth of what it is or may be."""
    least = {"g": 10.0, "phi_0": 1.0, "F_X": 1.0, "F_Z": 1.0, "M_Y": 0.1, "cycle": 1.0, "c_zeta": 1.0, "c_phi": 1e-3}
    most = 0.0
    for name, by in zip((*SCALARS, *FRUSTA), (*direction.scalars, *direction.frusta), strict=True):
        scale = max(float(np.abs(getattr(c, name)).max()), least.get(name, 0.0))
        most = max(most, float(np.abs(by).max()) / scale)
    if len(direction.terms):
        value = np.abs(c.terms[tuple(direction.where.T)])
        likely = np.where(value > 0, value, RANGE[direction.where[:, 2]])
        most = max(most, float((np.abs(direction.terms) / likely).max()))
    return 1e-6 / most if most else 1.0
