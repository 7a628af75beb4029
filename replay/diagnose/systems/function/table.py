"""Reads a table of readings: separators, decimal commas, units in headers and missing values of loggers."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.replay.errors import ReplayError
from straw.rig.tables.units import unit_in, unit_of

Floats = NDArray[np.float64]


def read_table(path: Path, columns: tuple[str, ...] | None = None) -> dict[str, Floats]:
    """Columns (n,) by name of a CSV or TSV file, NaN where a cell is empty or no number.

    The first line names the columns unless ``columns`` does. Raises ReplayError for what is no table.
    """
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as problem:
        raise ReplayError(f"{path}: cannot be read: {problem.strerror}") from problem
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise ReplayError(f"{path}: has {len(lines)} lines; a table needs a header and readings")
    separator = max(";\t,", key=lambda s: min(line.count(s) for line in lines[:20]))
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO("\n".join(lines)), delimiter=separator)]
    if columns is None:
        names, rows = [name.strip().strip('"') for name in rows[0]], rows[1:]
        if all(_number(name, separator) is not None for name in names):
            raise ReplayError(
                f'{path}: has no line of names; name its columns in the system: columns = ("time_s", ...)'
            )
    else:
        names = list(columns)
    out: dict[str, Floats] = {}
    for k, name in enumerate(names):
        if name and name != "-":
            cells = [_number(row[k], separator) if k < len(row) else None for row in rows]
            out[name] = np.array([np.nan if x is None else x for x in cells])
    return out


def _number(cell: str, separator: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        pass
    if separator != "," and "," in cell:
        try:
            return float(cell.replace(".", "").replace(",", "."))
        except ValueError:
            return None
    return None


def column(path: str, table: Mapping[str, Floats], name: str, wanted_by: str, unit: str = "") -> Floats:
    """A column by its name, ignoring case and brackets; ReplayError names the existing ones, or the heading's unit
    where it differs from the required one."""
    if name in table:
        return _numbers(path, table, name)

    def plain(text: str) -> str:
        return text.split("[")[0].split("(")[0].strip().lower()

    same = [known for known in table if plain(known) == plain(name)]
    if len(same) == 1:
        there, wanted = unit_in(same[0]), unit_of(unit)
        if there and wanted and there != wanted:
            raise ReplayError(f'{path}: column "{same[0]}" is in {there}, {wanted_by} in {unit}; convert one of them')
        return _numbers(path, table, same[0])
    raise ReplayError(f'{path}: no column "{name}", which {wanted_by} wants; there are: {", ".join(table)}')


def _numbers(path: str, table: Mapping[str, Floats], name: str) -> Floats:
    try:
        return np.asarray(table[name], dtype=np.float64)
    except (TypeError, ValueError):
        raise ReplayError(f'{path}: column "{name}" is no column of numbers; mend read, or name another') from None
