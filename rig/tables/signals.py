"""Signals: a column in SI, after checks of magnitude, length and type against its role."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.tables.mapping import TableMap, Use
from straw.rig.tables.roles import ROLES, TIP
from straw.rig.tables.table import Doubt, Table
from straw.rig.tables.times import Times
from straw.rig.tables.units import check_size, factor, looks_like, unit_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Signal:
    """One column on its way into the run: ``values`` (m,) in SI, ``how`` it was found, ``size`` for people."""

    role: str
    column: str
    unit: str
    channel: int
    values: Floats
    how: str
    text: tuple[str, ...] = ()


def signal_of(
    table: Table, role: str, use: Use, said: TableMap, clock: Times, how: str, as_stated: bool
) -> tuple[Signal, Doubt | None]:
    """One column in its role, in SI, at the times kept, and what was guessed of its unit. RigError, with place and
    cure, for a column of another length, of words, of no such unit, or of a size that no run has."""
    column, quantity = table.column(use.column), ROLES[role].quantity
    where, flag = f"{table.name}: column {column.name!r}", f"--{role.replace('_', '-')}"
    if clock.unit != "rows" and len(column) <= int(clock.keep[-1]):
        raise RigError(
            f"{where} has {len(column)} values, but there are {int(clock.keep[-1]) + 1} times; cut or fill it"
        )
    if clock.unit == "rows" and len(column) < len(clock.keep):
        raise RigError(f"{where} has {len(column)} values, the longest column {len(clock.keep)}; cut or fill it")
    if role == "event":
        words = column.text or tuple(f"{value:g}" if np.isfinite(value) else "" for value in column.values)
        kept = tuple(words[k].strip() for k in clock.keep)
        return Signal(role, column.name, "", 1, np.full(len(kept), np.nan), how, kept), None
    if column.is_text:
        first = next((cell for cell in column.text or () if cell.strip()), "")
        truth = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0}
        if role != "valid" or any(cell.strip().casefold() not in truth for cell in column.text or ()):
            raise RigError(f"{where} holds words ({first!r}), where {flag} wants numbers; name another column")
        column = replace(column, values=np.array([truth[cell.strip().casefold()] for cell in column.text or ()]))
    raw = (column.values[clock.keep] - use.zero) * use.factor
    if quantity == "number":
        return Signal(role, column.name, "", use.channel, raw, how), None
    unit = unit_of(use.unit or column.unit, quantity)
    doubt = None
    if use.unit or column.unit:
        si = factor(use.unit or column.unit, quantity, where)
        if not role.startswith("sigma") and role != "flow" and not as_stated:
            check_size(raw, unit, quantity, where, flag)
    else:
        likely = looks_like(raw, quantity)
        if quantity == "flow" or not likely:
            raise RigError(f'{where} has no unit; give {flag} "{column.name} in UNIT"')
        unit = likely[0]
        si = factor(unit, quantity, where)
        others = f" ({' or '.join(likely[1:3])} would do, too)" if len(likely) > 1 else ""
        doubt = Doubt(f"{column.name!r} is in {unit}{others}", f'{flag} "{column.name} in {unit}"')
    if unit == "px":
        return Signal(role, column.name, unit, 1, _from_px(table, role, raw, said), how), doubt
    values = raw * si
    if role == "pressure" and not as_stated and not use.zero:
        _check_gauge(values, where, column.name, unit, si)
    return Signal(role, column.name, unit, use.channel, values, how), doubt


def _check_gauge(values: Floats, where: str, name: str, unit: str, si: float) -> None:
    """A gauge pressure is near 0 somewhere; one that stays near atmospheric pressure is absolute."""
    good = values[np.isfinite(values)]
    if len(good) and 85e3 <= good[0] <= 108e3 and np.min(good) > 40e3:
        raise RigError(
            f"{where}: starts at {good[0] / si:g} {unit}, as the air has: looks absolute, not gauge; in a mapping "
            f'say pressure = {{ column = "{name}", unit = "{unit}", zero = {good[0] / si:.6g} }}, or --as-stated'
        )


def _from_px(table: Table, role: str, raw: Floats, said: TableMap) -> Floats:
    if said.mm_per_px is None:
        raise RigError(f"{table.name}: its points are in px; give --mm-per-px, and --origin-px U,V of the straw's base")
    if said.origin_px is None:
        raise RigError(f"{table.name}: its points are in px; give --origin-px U,V, the middle of the straw's base")
    scale = said.mm_per_px * 1e-3
    if role.startswith("sigma"):
        return raw * scale
    if role == "x":
        return (raw - said.origin_px[0]) * scale
    return (raw - said.origin_px[1]) * (-scale)  # a picture counts downwards


def from_points(table: Table, said: TableMap, clock: Times) -> list[Signal]:
    """Tip and angle from two points along its axis, the far one being the tip."""
    assert said.points
    found = []
    for name in said.points:
        if name not in table.points:
            raise RigError(f"{table.name}: no point {name!r}; it has {', '.join(map(repr, table.points)) or 'none'}")
        found.append(table.points[name])
    near, far = found
    if near.time and near.time != far.time:
        one, other = table.columns[near.time].text, table.columns[far.time].text
        if one != other:
            raise RigError(
                f"{table.name}: {said.points[0]!r} and {said.points[1]!r} have different times; export both whole"
            )
    values = {}
    for label, point in (("near", near), ("far", far)):
        for role, name in (("x", point.x), ("z", point.y)):
            signal, doubt = signal_of(table, role, Use(name, said.points_unit), said, clock, "stated", as_stated=True)
            if doubt:
                raise RigError(f"{table.name}: its points have no unit; give --points-unit m, mm or px")
            values[label, role] = signal
    dx = values["far", "x"].values - values["near", "x"].values
    dz = values["far", "z"].values - values["near", "z"].values
    phi = np.full(len(dx), np.nan)
    good = np.isfinite(dx) & np.isfinite(dz)
    phi[good] = np.unwrap(np.arctan2(dx[good], dz[good]))
    out = [
        values["far", "x"],
        values["far", "z"],
        Signal("phi", f"{said.points[0]} to {said.points[1]}", "rad", 1, phi, "stated"),
    ]
    chances = [table.columns[point.likelihood].values[clock.keep] for point in (near, far) if point.likelihood]
    if chances:
        out.append(
            Signal("likelihood", f"{near.likelihood}, {far.likelihood}", "", 1, np.min(chances, axis=0), table.format)
        )
    return out


def check_tip(table: Table, signals: list[Signal]) -> None:
    """RigError where a tip lacks a part, or where it is not stated which points of a video are the tip."""
    there = {signal.role for signal in signals}
    missing = [role for role in TIP if role not in there]
    if set(TIP) & there and missing:
        points = f", or --points NEAR FAR, two of {', '.join(map(repr, table.points))}" if len(table.points) > 1 else ""
        raise RigError(
            f"{table.name}: a tip is x, z and phi; not named: {' and '.join(missing)}"
            f"; give --{missing[0]} COLUMN{points}, or leave the tip out: --{next(r for r in TIP if r in there)} none"
        )
    if len(table.points) > 1 and not there:
        raise RigError(
            f"{table.name}: which points are the tip? --points NEAR FAR, two of {', '.join(map(repr, table.points))}"
        )
