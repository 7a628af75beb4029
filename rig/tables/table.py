"""Table: what a file of another logger holds, before its columns have a meaning."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Column:
    """One column: ``values`` (n,) as numbers in the file's own unit, NaN where there is none.

    ``text`` is what stands in a text file, cell by cell: times are read from it exactly. ``whole`` are integers too
    large for a float (nanoseconds). ``unit`` is what the format or the header says, "" where neither does.
    """

    name: str
    values: Floats
    text: tuple[str, ...] | None = None
    whole: NDArray[np.int64] | None = None
    unit: str = ""

    @property
    def is_text(self) -> bool:
        """Whether the cells are text: dates, states, remarks."""
        return self.text is not None and len(self.text) > 0 and bool(np.all(np.isnan(self.values)))

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Point:
    """A marker that a video program followed: the names of its columns."""

    x: str
    y: str
    likelihood: str = ""
    time: str = ""


@dataclass(frozen=True)
class Doubt:
    """Something that was read in one of several possible ways, and the flag that settles it."""

    what: str
    say: str


@dataclass(frozen=True, eq=False)
class Table:
    """One file. ``lines`` (n,) is where each row stands in it, from 1; columns of MAT files may differ in length.

    ``roles`` are those that the format itself defines, which count as no guess. ``notes``: sentences on what was left
    out; ``doubts``: what could have been read otherwise; ``reader``: the user's own reader that read it, if any.
    """

    path: Path
    format: str
    columns: dict[str, Column]
    lines: NDArray[np.int64]
    about: str = ""
    roles: dict[str, str] = field(default_factory=dict)
    points: dict[str, Point] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    y_down: bool = False
    reader: str = ""

    @property
    def name(self) -> str:
        """The file's name, for messages."""
        return self.path.name

    def column(self, named: str) -> Column:
        """A column by its name, by its name in other letters or without its unit, or by its number from 1."""
        if found := self.find(named):
            return found
        raise RigError(f"{self.name}: no column {named!r}; its columns are {self.names()}")

    def find(self, named: str) -> Column | None:
        """As ``column``, None where there is none."""
        if named in self.columns:
            return self.columns[named]
        alike = [one for one in self.columns.values() if one.name.casefold().strip() == named.casefold().strip()]
        if len(alike) == 1:
            return alike[0]
        if named.strip().isdecimal() and 1 <= int(named) <= len(self.columns):
            return list(self.columns.values())[int(named) - 1]
        return None

    def names(self) -> str:
        """Its columns for a message, not more than a dozen."""
        names = [repr(name) for name in self.columns]
        return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")

    def where(self, row: int) -> str:
        """The place of a row, for a message."""
        return f"line {self.lines[row]}" if row < len(self.lines) else f"row {row + 1}"


@dataclass(frozen=True)
class Reading:
    """How a text file is to be read, as stated by the user; None is determined from the file."""

    format: str | None = None
    separator: str | None = None
    decimal: str | None = None
    thousands: str | None = None
    encoding: str | None = None
    skip: int = 0
