"""Text files of any logger as a grid of cells: encoding, separator, heading, torn lines."""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from straw.rig.errors import RigError
from straw.rig.tables.formats._numbers import is_nothing, looks_like_data, looks_numeric, marks, number
from straw.rig.tables.table import Column, Doubt, Reading, Table
from straw.rig.tables.units import unit_in

SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "space": " "}
_WORDS = {value: key for key, value in SEPARATORS.items()}
_COMMENT = ("#", "%", "//", "=~")
#: A serial line that loses more than one line in twenty is not read as the format it is.
MOST_TORN = 0.05


@dataclass
class Grid:
    """Cells of a text file: one list a row, all of one length; ``top``: lines above, ``torn``: line numbers."""

    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    separator: str
    top: list[str] = field(default_factory=list)
    torn: list[int] = field(default_factory=list)


def decode(data: bytes, name: str, encoding: str | None = None) -> str:
    """The text of a file: by its byte order mark, as UTF-8, else as Windows writes it; RigError for what is no text."""
    if encoding:
        try:
            return data.decode(encoding).removeprefix("\ufeff")
        except (LookupError, UnicodeDecodeError):
            raise RigError(f"{name}: cannot be read as {encoding!r}; leave --encoding away, or name another") from None
    for mark, codec in ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if data.startswith(mark):
            return data.decode(codec, "replace")
    if b"\0" in data[:65536] or sum(byte < 9 for byte in data[:4096]) > 0:
        raise RigError(f"{name}: is not a text file; save the table as CSV")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def is_text(data: bytes) -> bool:
    """Whether this may be a text file."""
    return data.startswith((b"\xff\xfe", b"\xfe\xff")) or (bool(data.strip()) and not any(b < 9 for b in data[:4096]))


def head(data: bytes, lines: int = 5) -> list[str]:
    """The first lines that are not blank, to recognise a format by."""
    try:
        text = decode(data[:20000], "")
    except RigError:
        return []
    return [line for line in re.split(r"\r\n|\n|\r", text) if line.strip()][:lines]


def cells(line: str, separator: str) -> list[str]:
    """One line in its cells, without blanks around them."""
    if separator == " ":
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    return [cell.strip() for cell in line.split(separator)]


def grid(text: str, name: str, reading: Reading) -> Grid:
    """The grid of a text; RigError where no rows of numbers are found, or too many do not fit."""
    numbered = [(k, line) for k, line in enumerate(re.split(r"\r\n|\n|\r", text), 1) if line.strip()]
    numbered = [(k, line) for k, line in numbered if k > reading.skip]
    separator = reading.separator
    if numbered and (told := re.fullmatch(r"sep=(.)", numbered[0][1].strip().strip('"'))):  # as Excel wants it
        separator, numbered = separator or told[1], numbered[1:]
    if separator is None:
        separator = _separator([line for _, line in numbered if not line.lstrip().startswith(_COMMENT)])
    split = [(k, cells(line, separator), line) for k, line in numbered]
    data = [(k, row) for k, row, line in split if not line.lstrip().startswith(_COMMENT) and _is_data(row)]
    if not data:
        raise RigError(f"{name}: no rows of numbers are found in it; is it a table? Give --separator or --skip LINES")
    width, trailing = _width([row for _, row in data])
    first = next(k for k, row in data if len(row) in (width, width + trailing))
    rows, lines, torn = [], [], []
    for k, row, line in split:
        if line.lstrip().startswith(_COMMENT) or (k < first and not _is_data(row)):
            continue
        if len(row) == width + 1 and not row[-1]:
            row = row[:-1]
        if len(row) == width and k >= first:
            rows.append(row)
            lines.append(k)
        else:
            torn.append(k)
    above = [(row, line) for k, row, line in split if k < first and k not in torn]
    names = _names(above, width, separator)
    return Grid(names, rows, lines, separator, [line for _, line in above], torn)


def table(path: Path, form: str, found: Grid, reading: Reading) -> Table:
    """A table of a grid: numbers where a column is of numbers; rows with a torn cell among them are left out."""
    columns = list(zip(*found.rows, strict=True))
    numeric = [_mostly(column) for column in columns]
    sample = (cell for column, yes in zip(columns, numeric, strict=True) if yes for cell in column)
    decimal, thousands, doubt = marks((c for c in sample if looks_numeric(c)), found.separator)
    doubts: list[Doubt] = []
    if reading.decimal or reading.thousands:
        decimal = reading.decimal or ("," if reading.thousands == "." else ".")
        thousands = reading.thousands or ""
    elif doubt:
        doubts.append(Doubt(doubt, f"--decimal {decimal}" + (f" --thousands {thousands}" if thousands else "")))
    values = [
        _numbers(column, decimal, thousands) if yes else [np.nan] * len(column)
        for column, yes in zip(columns, numeric, strict=True)
    ]
    bad = {k for column in values for k, value in enumerate(column) if value is None}
    torn = sorted(found.torn + [found.lines[k] for k in bad])
    total = len(found.rows) + len(found.torn)
    if len(torn) > max(1.0, MOST_TORN * total):
        raise RigError(
            f"{path.name}: {len(torn)} of {total} lines do not fit {len(columns)} columns of numbers separated by "
            f"{_WORDS.get(found.separator, found.separator)} (line {torn[0]}); give --separator, --decimal or --skip"
        )
    keep = [k for k in range(len(found.rows)) if k not in bad]
    made: dict[str, Column] = {}
    for name, column, numbers in zip(found.names, columns, values, strict=True):
        held = np.array([numbers[k] for k in keep], dtype=np.float64)
        text = tuple(_plain(column[k], decimal, thousands) for k in keep)
        made[name] = Column(name, held, text, unit=unit_in(name))
    notes = []
    if torn:
        shown = ", ".join(map(str, torn[:6])) + (", ..." if len(torn) > 6 else "")
        notes.append(f"{len(torn)} torn {'line is' if len(torn) == 1 else 'lines are'} left out ({shown})")
    said = f"{_WORDS.get(found.separator, found.separator)}-separated, decimal {'comma' if decimal == ',' else 'point'}"
    lines = np.array([found.lines[k] for k in keep], dtype=np.int64)
    return Table(path, form, made, lines, about=said, notes=tuple(notes), doubts=tuple(doubts))


def _plain(text: str, decimal: str, thousands: str) -> str:
    """A cell with a decimal point and without thousands, where it is a number; else as it is."""
    if (decimal == "." and not thousands) or not looks_numeric(text):
        return text
    if thousands == decimal:
        before, mark, after = text.rpartition(decimal)
        return before.replace(decimal, "") + mark + after
    return (text.replace(thousands, "") if thousands else text).replace(decimal, ".")


def _numbers(column: tuple[str, ...], decimal: str, thousands: str) -> list[float | None]:
    if decimal == "." and not thousands:
        try:
            return list(map(float, column))
        except ValueError:
            pass  # some of the columns are ambiguous
    return [number(cell, decimal, thousands) for cell in column]


def _mostly(column: tuple[str, ...]) -> bool:
    """At least four of five non-empty cells: a torn cell does not make a column of numbers one of words."""
    there = [cell for cell in column if not is_nothing(cell)]
    return not there or sum(map(looks_numeric, there)) >= 0.8 * len(there)


def _is_data(row: list[str], more_than_half: bool = False) -> bool:
    there = [cell for cell in row if cell]
    data = 2 * sum(looks_like_data(cell) or is_nothing(cell) for cell in there)
    return bool(there) and (data > len(there) or (data == len(there) and not more_than_half))


def _separator(lines: list[str]) -> str:
    """Of the separators the first by which most lines have one number of cells, more than one, mostly data."""
    sample = lines[:: max(1, len(lines) // 400)]
    for separator in SEPARATORS.values():
        rows = [row for row in (cells(line, separator) for line in sample) if _is_data(row, more_than_half=True)]
        if not rows or 2 * len(rows) < len(sample):
            continue
        width, _ = _width(rows)
        if width > 1 and sum(len(row) in (width, width + 1) for row in rows) >= 0.7 * len(rows):
            return separator
    return ","


def _width(rows: list[list[str]]) -> tuple[int, int]:
    """How many cells most rows have, and 1 where another, empty one follows from a separator at the end."""
    counts = Counter(len(row) for row in rows)
    width = counts.most_common(1)[0][0]
    at_width = [row for row in rows if len(row) == width]
    if width > 1 and all(not row[-1] for row in at_width):
        return width - 1, 1
    return width, 0


def _names(above: list[tuple[list[str], str]], width: int, separator: str) -> list[str]:
    """Names from the line above the data, or from a comment there; with the units of a line of their own."""
    names: list[str] = []
    units: list[str] = []
    for row, line in reversed(above[-3:]):
        if line.lstrip().startswith(_COMMENT):
            row = cells(line.lstrip().lstrip("#%/ "), separator)
        row = row[:width] if len(row) == width + 1 and not row[-1] else row
        if len(row) != width:
            continue
        if not units and not names and all(not cell or unit_in(f"[{cell.strip('[]() ')}]") for cell in row):
            units = [cell.strip("[]() ") for cell in row]
            continue
        names = row
        break
    if not names and units:  # a heading whose letters happen to be units, too: x, m, s
        names, units = units, []
    names = [name or f"column {k}" for k, name in enumerate(names, 1)] or [f"column {k}" for k in range(1, width + 1)]
    if units and any(units):
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    return unique(names)


def unique(names: list[str]) -> list[str]:
    """The same names, with a number appended to repeated ones."""
    seen: Counter[str] = Counter()
    out = []
    for name in names:
        seen[name] += 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return out
