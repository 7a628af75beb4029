"""Reader: a user's own format, from a file or a package; its tables are checked before they are used."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.plugged import said
from straw.rig import parts
from straw.rig.errors import RigError
from straw.rig.tables.formats import Format, formats
from straw.rig.tables.roles import ROLES
from straw.rig.tables.table import Column, Reading, Table
from straw.rig.tables.units import UNITS, unit_in, unit_of


@dataclass(frozen=True)
class Reader:
    """Reads what one logger writes: ``READER = straw.Reader(name="daq", about="...", read=read, suffixes=(".daq",))``.

    ``read(path)`` gives columns by their names, each (n,): numbers, words, or moments (``datetime64``, UTC); NaN where
    there is no value. ``roles`` says which column is what ("time", "pressure", "command", "flow", "x", "z", "phi",
    ...), ``units`` in which unit it is (as "mbar"; else the one behind its name, as in "P [mbar]"); neither counts as a
    guess. ``suffixes`` of the files that it reads, or ``recognises(path, first_bytes) -> bool``.
    """

    name: str
    about: str
    read: Callable[[Path], Mapping[str, Any]]
    suffixes: tuple[str, ...] = ()
    recognises: Callable[[Path, bytes], bool] | None = None
    roles: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"reader {self.name!r}"
        if not isinstance(self.name, str) or not re.fullmatch(r"[a-z][a-z0-9_-]*", self.name):
            raise RigError(f"{where}: its name must be a word of small letters, digits, - and _, for --format")
        if not isinstance(self.about, str) or not self.about.strip():
            raise RigError(f"{where}: about is empty; state in words what it reads")
        if not callable(self.read) or not (self.recognises is None or callable(self.recognises)):
            raise RigError(f"{where}: read and recognises are functions: read(path), recognises(path, first_bytes)")
        if any(not str(one).startswith(".") or len(str(one)) < 2 for one in self.suffixes):  # a lone word, too
            raise RigError(f'{where}: suffixes = {self.suffixes!r}; write them with their point, as (".daq",)')
        for column, role in self.roles.items():
            if role not in ROLES:
                raise RigError(f"{where}: roles: {column!r} is {role!r}; known: {', '.join(ROLES)}")
            quantity = ROLES[role].quantity
            unit = self.units.get(column)
            if unit is not None and not unit_of(unit, quantity):
                raise RigError(
                    f"{where}: units: {column!r} in {unit!r} is no {quantity}; known: {', '.join(UNITS[quantity])}"
                )


READERS = parts.Kind("reader", ("READER", "READERS"), Reader)


def add_readers(*paths: str | Path) -> None:
    """Register the readers in these files; RigError, one line, for a file that gives none."""
    parts.add(READERS, paths)


def reader_in(path: Path) -> Format:
    """The first reader a file gives, as a format."""
    return _format(parts.in_file(READERS, path.resolve())[0])


def reader_formats() -> dict[str, Format]:
    """External readers as formats, by name."""
    found: dict[str, Format] = {}
    for part in parts.parts(READERS):
        if part.what.name in found or part.what.name in formats():
            raise RigError(f"{part.where}: reader {part.what.name}: there is a format of this name; give yours another")
        found[part.what.name] = _format(part)
    return found


def tried(form: Format, path: Path) -> int:
    """Read truncated and corrupted copies of a file: each gives a table or a RigError; return how many there were.

    Other exceptions of the function are RigErrors already; this finds readers that never end, or end Python.
    """
    data = path.read_bytes()
    middle = len(data) // 2
    spoiled = [data[: int(share * len(data))] for share in (0.02, 0.3, 0.5, 0.9)]
    spoiled += [data[:middle] + b"\xff\x00\xfe" + data[middle:], b"no table\n"]
    with tempfile.TemporaryDirectory() as folder:
        for one in spoiled:
            copy = Path(folder) / path.name
            copy.write_bytes(one)
            with suppress(RigError):
                form.read(copy, one, Reading())
    return len(spoiled)


def _format(part: parts.Part) -> Format:
    one: Reader = part.what
    return Format(one.name, one.about, partial(_recognises, part), partial(_read, part), rank=0)


def _recognises(part: parts.Part, path: Path, data: bytes) -> bool:
    one: Reader = part.what
    if one.recognises is None:
        return path.suffix.casefold() in (suffix.casefold() for suffix in one.suffixes)
    try:
        return bool(one.recognises(path, data[:65536]))
    except Exception as error:
        place = _file(part)
        raise RigError(
            f"{part.where}: reader {one.name}: recognises({path.name}) raises {said(error, place)}"
        ) from None


def _file(part: parts.Part) -> Path | None:
    return Path(part.where) if part.sha256 else None


def _read(part: parts.Part, path: Path, _data: bytes, _reading: Reading) -> Table:
    """The table that a reader's function returns; RigError, one line, where it raises or returns no table."""
    one: Reader = part.what
    where = f"{part.where}: reader {one.name}: read({path.name})"
    try:
        found = one.read(path)
    except Exception as error:  # the user's code may raise anything
        raise RigError(f"{where} raises {said(error, _file(part))}; is {path.name} whole?") from None
    if not isinstance(found, Mapping) or not found:
        raise RigError(f"{where} gives {_short(found)}; expected columns by their names, as {{'t': ..., 'p': ...}}")
    columns = {str(name): _column(where, str(name), values, one.units.get(name)) for name, values in found.items()}
    first = next(iter(columns))
    for name, column in columns.items():
        if len(column) != len(columns[first]):
            raise RigError(
                f"{where}: {name!r} has {len(column)} rows, {first!r} {len(columns[first])}; make them equal"
            )
    if not len(columns[first]):
        raise RigError(f"{where}: its columns have no rows; is {path.name} whole?")
    for name in (*one.roles, *one.units):
        if name not in columns:
            raise RigError(f"{where}: gives no column {name!r}, which roles or units name; there are {_names(columns)}")
    for name, role in one.roles.items():
        if not columns[name].is_text and columns[name].whole is None and not np.any(np.isfinite(columns[name].values)):
            raise RigError(f"{where}: {name!r} ({role}) has no finite number in {len(columns[name])} rows")
    rows = np.arange(1, len(columns[first]) + 1)
    return Table(
        path, one.name, columns, rows, about=f"read by {part.origin}", roles=dict(one.roles), reader=part.origin
    )


def _column(where: str, name: str, values: Any, unit: str | None) -> Column:
    told = unit_in(name) if unit is None else unit_of(unit)
    try:
        array = np.asarray(values)
    except ValueError:
        raise RigError(f"{where}: {name!r} is no column; expected (n,) numbers, words or moments") from None
    if array.ndim != 1:
        raise RigError(f"{where}: {name!r} has shape {array.shape}; expected (n,)")
    if array.dtype.kind == "M":
        if np.any(np.isnat(array)):
            raise RigError(f"{where}: {name!r} lacks {int(np.isnat(array).sum())} moments; leave these rows out")
        whole = array.astype("datetime64[ns]").astype(np.int64)
        return Column(name, whole.astype(np.float64), None, whole, "ns")
    if array.dtype.kind in "iu":
        return Column(name, array.astype(np.float64), None, array.astype(np.int64), told)
    if array.dtype.kind in "fb":
        return Column(name, array.astype(np.float64), unit=told)
    if array.dtype.kind == "U" or (array.dtype == object and all(isinstance(v, str) for v in array)):
        return Column(name, np.full(len(array), np.nan), tuple(map(str, array)), unit=told)
    raise RigError(f"{where}: {name!r} is of {array.dtype}; expected numbers, words or moments")


def _names(columns: Mapping[str, Column]) -> str:
    return ", ".join(map(repr, list(columns)[:12]))


def _short(value: object) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) < 60 else text[:57] + "..."
