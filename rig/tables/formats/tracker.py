"""Tables of Tracker (Open Source Physics): the name of the point mass, then t, x, y, ... in calibrated units.

As published exports look: "mass_A", then "t<tab>x<tab>y", then rows (strandlie/tfy4125, iptrack.py), with a decimal
comma and a real minus sign, also in exponents, on computers set so.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from straw.rig.tables.formats import Format
from straw.rig.tables.formats._text import cells, decode, grid, head, table, unique
from straw.rig.tables.table import Point, Reading, Table


def _headings(lines: list[str]) -> tuple[list[str], list[str]] | None:
    """Names of the points, one for each column, and of the columns; None where it is no such table."""
    if len(lines) < 2:
        return None
    for separator in ("\t", ",", ";"):
        over, under = cells(lines[0], separator), cells(lines[1], separator)
        while under and not under[-1]:
            under.pop()
        if len(under) < 3 or under[0] != "t" or not {"x", "y"} <= set(under):
            continue
        named = [name for name in over if name]
        if not named or any(name in ("t", "x", "y") for name in named):
            continue
        if len(named) == 1:
            return [named[0]] * len(under), under
        over = (over + [""] * len(under))[: len(under)]
        filled, last = [], ""
        for name in over:
            last = name or last
            filled.append(last)
        return filled, under
    return None


def recognises(path: Path, data: bytes) -> bool:
    """A line of names above a line that begins with t and holds x and y."""
    return _headings(head(data, 2)) is not None


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Time is in s and y points upwards, as Tracker has it; lengths are in the unit of its calibration stick."""
    text = decode(data, path.name, reading.encoding)
    found = grid(text, path.name, reading)
    headings = _headings(head(data, 2))
    assert headings is not None
    over, under = headings
    if len(under) == len(found.names):
        several = len(set(over)) > 1
        found.names = unique([f"{o} {u}" if several and u != "t" else u for o, u in zip(over, under, strict=True)])
    raw = table(path, "Tracker", found, reading)
    columns = dict(raw.columns)
    points = {}
    for name in dict.fromkeys(over):
        pair = (f"{name} x", f"{name} y") if len(set(over)) > 1 else ("x", "y")
        if pair[0] in columns and pair[1] in columns:
            points[name] = Point(*pair)
    roles = {}
    for name, column in columns.items():
        if name == "t":
            columns[name] = replace(column, unit="s")
            roles[name] = "time"
    if len(points) == 1:
        roles |= {"x": "x", "y": "z"}
    return replace(raw, columns=columns, roles=roles, points=points)


FORMAT = Format("tracker", "Tracker (Open Source Physics) tables", recognises, read, rank=20)
