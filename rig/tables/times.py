"""Times of a table: their unit, their zero, and what is done where they run backwards."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.tables.mapping import TableMap, Use
from straw.rig.tables.moments import is_moment, moments, nanoseconds
from straw.rig.tables.table import Column, Doubt, Table
from straw.rig.tables.units import unit_of

Whole = NDArray[np.int64]
_UNIT_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1, "min": 60 * 10**9, "h": 3600 * 10**9}
_UNIT_NS |= {"labview": 10**9, "excel": 86400 * 10**9}
LABVIEW_S = 2_082_844_800  # from LabVIEW's zero, 1904, to 1970
EXCEL_DAYS = 25_569  # from a spreadsheet's zero, 1899-12-30, to 1970
_ABSOLUTE_S = 5e8  # no clock started for this run has counted 16 years
_LATER_S = 3e9  # seconds since 1970 reach this in 2065; since 1904, in 1999
DAY_NS = 86400 * 10**9


@dataclass(frozen=True)
class Times:
    """``ns`` (m,) of the rows ``keep`` (m,) of the table, since 1970 where ``absolute``, else since its own zero."""

    ns: Whole
    keep: Whole
    absolute: bool
    unit: str
    doubts: tuple[Doubt, ...] = ()
    notes: tuple[str, ...] = ()


def times(table: Table, use: Use | None, said: TableMap, zone: tzinfo | None) -> Times:
    """The times of a table's rows; RigError, with place and cure, where they are none or run back."""
    if use is None:
        assert said.rate_hz
        n = max(len(column) for column in table.columns.values())
        return Times(np.round(np.arange(n) * (1e9 / said.rate_hz)).astype(np.int64), np.arange(n), False, "rows")
    column = table.column(use.column)
    where = f"{table.name}: column {column.name!r}"
    flag = f'--time "{column.name} in'
    doubts: list[Doubt] = []
    if column.is_text and column.text and is_moment(next((c for c in column.text if c.strip()), "").strip()):
        keep = np.array([k for k, cell in enumerate(column.text) if cell.strip()], dtype=np.int64)
        found = moments([column.text[k].strip() for k in keep], zone, said.date_order, where)
        if found.no_zone:
            doubts.append(Doubt("times without a zone are taken as UTC", "--time-zone UTC (or Europe/Berlin, +02:00)"))
        if found.order:
            doubts.append(Doubt(f"dates are read as {found.order}", f"--date-order {found.order}"))
        ns, absolute, unit = np.array(found.ns, dtype=np.int64), found.absolute, "date" if found.absolute else "clock"
    elif column.is_text:
        first = next((cell for cell in (column.text or ()) if cell.strip()), "")
        raise RigError(f"{where}: {first!r} is neither a number nor a date; name another with --time")
    else:
        keep = np.flatnonzero(np.isfinite(column.values))
        if not len(keep):
            raise RigError(f"{where}: holds no times; name another with --time")
        unit = unit_of(use.unit or column.unit, "time")
        if use.unit and not unit:
            raise RigError(f"{where}: {use.unit!r} is not a unit of time; known: {', '.join(_UNIT_NS)}")
        if not unit:
            unit = _looks(column.values[keep])
            doubts.append(Doubt(f"time counts in {unit}", f'{flag} {unit}"'))
        ns = _exact(column, keep, unit, use)
        absolute = unit in ("labview", "excel") or abs(float(ns[0])) > _ABSOLUTE_S * 1e9
        if unit == "labview":
            ns = ns - LABVIEW_S * 10**9
        elif absolute and unit == "s" and ns[0] > _LATER_S * 1e9:
            ns = ns - LABVIEW_S * 10**9
            doubts.append(Doubt("time counts from 1904, as LabVIEW does", f'{flag} labview"'))
        elif unit == "excel":
            ns = _local(ns - EXCEL_DAYS * DAY_NS, zone)
            if zone is None:
                doubts.append(Doubt("days of a spreadsheet are taken as UTC", "--time-zone UTC (or Europe/Berlin)"))
    left = len(column) - len(keep)
    notes = [f"{left} rows without a time are left out"] if left else []
    ns, kept, said_back = _forward(table, ns, keep, said, unit, where)
    if len(ns) > 1 and ns[0] == ns[-1]:
        raise RigError(
            f"{where}: time stands at one value in all {len(ns)} rows; name another with --time, or --rate HZ"
        )
    if repeats := int(np.sum(np.diff(ns) == 0)):
        notes.append(f"{repeats} rows repeat the time before them; readers of the run use the first of each")
    return Times(ns, kept, absolute, unit, tuple(doubts), (*notes, *said_back))


def _exact(column: Column, keep: Whole, unit: str, use: Use) -> Whole:
    """Nanoseconds as written, without the rounding of floats."""
    unit_ns = _UNIT_NS[unit]
    plain = use.zero == 0.0 and use.factor == 1.0
    try:
        if plain and column.whole is not None:
            return column.whole[keep] * unit_ns
        if plain and column.text is not None:
            return np.array([nanoseconds(column.text[k], unit_ns) for k in keep], dtype=np.int64)
    except (ValueError, OverflowError):
        pass  # in a notation that only float() parses
    return np.round((column.values[keep] - use.zero) * use.factor * unit_ns).astype(np.int64)


def _looks(values: NDArray[np.float64]) -> str:
    """The unit a column of times looks like: by its size where it counts from 1970, else by a usual rate."""
    size = float(np.median(np.abs(values)))
    for low, unit in ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (_ABSOLUTE_S, "s")):
        if size > low:
            return unit
    steps = np.abs(np.diff(values))
    step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    if 3e4 < size < 7e4 and step < 1e-3:
        return "excel"
    return "s" if step < 1.0 else "ms" if step < 1e3 else "us"


def _local(ns: Whole, zone: tzinfo | None) -> Whole:
    """Clock readings of a zone as UTC."""
    if zone is None or not len(ns):
        return ns
    first = datetime(1970, 1, 1) + timedelta(seconds=float(ns[0]) * 1e-9)
    offset = first.replace(tzinfo=zone).utcoffset() or timedelta()
    return ns - int(offset.total_seconds()) * 10**9


def _forward(
    table: Table, ns: Whole, keep: Whole, said: TableMap, unit: str, where: str
) -> tuple[Whole, Whole, tuple[str, ...]]:
    """Times that increase, by the stated remedy; without one, a RigError that says what it looks like."""
    back = np.flatnonzero(np.diff(ns) < 0)
    if not len(back):
        return ns, keep, ()
    at = int(back[0])
    wraps = _wraps(ns, unit)
    if said.back is None:
        looks = (
            f"looks like a counter that overflows after {wraps / _UNIT_NS.get(unit, 10**9):g} {unit}: give --back wrap"
            if wraps
            else f"looks like {len(back) + 1} records in one file: give --back part:N for one of them"
            if ns[at + 1] <= ns[0] + abs(ns[at] - ns[0]) // 20
            else "give --back drop (leaves such rows out) or sort"
        )
        raise RigError(
            f"{where}: time runs back at {table.where(int(keep[at + 1]))}, from {_show(ns[at], unit)} to "
            f"{_show(ns[at + 1], unit)}, {len(back)} times in all; {looks}"
        )
    if said.back == "drop":
        good = ns >= np.maximum.accumulate(ns)
        return ns[good], keep[good], (f"{int(np.sum(~good))} rows whose time ran back are left out",)
    if said.back == "sort":
        order = np.argsort(ns, kind="stable")
        return ns[order], keep[order], ("rows are sorted by time",)
    if said.back == "wrap":
        if not wraps:
            raise RigError(f"{where}: --back wrap: no counter starts again in it; {len(back)} rows run back otherwise")
        steps = np.diff(ns)
        turns = np.concatenate([[0], np.cumsum(np.round(-steps / wraps).astype(np.int64))])
        unwrapped = ns + turns * wraps
        if np.any(np.diff(unwrapped) < 0):
            k = int(np.flatnonzero(np.diff(unwrapped) < 0)[0])
            raise RigError(f"{where}: --back wrap leaves {table.where(int(keep[k + 1]))} running back; cut there")
        return unwrapped, keep, (f"the counter started again {int(np.sum(np.diff(turns) != 0))} times",)
    part = int(said.back.removeprefix("part:"))
    edges = [0, *(int(k) + 1 for k in back), len(ns)]
    if part > len(edges) - 1:
        raise RigError(f"{where}: --back part:{part}: there are {len(edges) - 1} parts, from 1")
    one = slice(edges[part - 1], edges[part])
    if edges[part] - edges[part - 1] < 2:
        raise RigError(
            f"{where}: --back part:{part}: it is a single row, {table.where(int(keep[one.start]))}; take another"
        )
    return ns[one], keep[one], (f"part {part} of {len(edges) - 1}: {table.where(int(keep[one.start]))} on",)


def _wraps(ns: Whole, unit: str) -> int:
    """After how many ns the counter starts again, 0 where it does not look like one."""
    lowest = float(np.min(np.diff(ns)))
    spans = (
        [DAY_NS] if unit == "clock" else [2**bits * _UNIT_NS[unit] for bits in (16, 32) if unit in ("ms", "us", "ns")]
    )
    for span in spans:
        if -lowest > 0.5 * span and float(np.max(ns)) < span:
            return span
    return 0


def _show(ns: np.int64, unit: str) -> str:
    return f"{int(ns) / _UNIT_NS.get(unit, 10**9):.12g} {unit if unit in _UNIT_NS else 's'}"
