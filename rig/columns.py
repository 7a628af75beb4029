"""Columns: what a table of recordings can show, sort, group and filter by, under one set of names."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import TypeAlias

from straw.rig.catalogue import Entry

Value: TypeAlias = str | float | tuple[str, ...] | None


@dataclass(frozen=True)
class Column:
    """One column: its title, its value for an entry, and a short description."""

    title: str
    value: Callable[[Entry], Value]
    about: str
    order: Callable[[Entry], Value] | None = None  # a cheaper key to sort by, if any


def _when(entry: Entry, letters: int) -> str | None:
    return datetime.fromtimestamp(entry.start_ns * 1e-9).isoformat(" ")[:letters] if entry.start_ns else None


def _pressure(entry: Entry, of: Callable[[Iterable[int]], int]) -> float | None:
    values = entry.preview.get("p")
    return of(values) / 10 if values else None


def _deployed(entry: Entry) -> str | None:
    return entry.metadata.get("initial_deployed", "").replace(" ", "") or None


#: By name. Units are in the titles; absent text is None, and so is an unknown number.
COLUMNS: dict[str, Column] = {
    "run": Column("run", lambda e: e.run_id or e.name, "its name"),
    "start": Column(
        "start", lambda e: _when(e, 19), "when it began, this computer's time zone", lambda e: e.start_ns or None
    ),
    "day": Column("day", lambda e: _when(e, 10), "the day it began"),
    "kind": Column("kind", lambda e: e.kind, "run, track, prediction, part (cut off) or unreadable"),
    "specimen": Column("specimen", lambda e: e.specimen or None, "which straw"),
    "protocol": Column("protocol", lambda e: e.protocol or None, "what was driven"),
    "cycle": Column("cycle", lambda e: float(e.cycle), "how often the specimen was cycled before"),
    "deployed": Column("deployed", _deployed, "cells deployed at the start"),
    "duration": Column("length / s", lambda e: e.duration_s, "how long it is, in seconds"),
    "lowest": Column("lowest / kPa", lambda e: _pressure(e, min), "lowest measured pressure"),
    "highest": Column("highest / kPa", lambda e: _pressure(e, max), "highest measured pressure"),
    "status": Column("status", lambda e: "damaged" if e.problem else e.status or None, "success, abort, fail, damaged"),
    "problem": Column("problem", lambda e: e.problem or None, "what is wrong with the file"),
    "tag": Column("tags", lambda e: e.tags, "any of its tags"),
    "note": Column("notes", lambda e: tuple(text for _, text in e.notes), "any of its notes"),
    "mark": Column("marks", lambda e: e.marks, "star, archive, lock"),
    "file": Column("file", lambda e: e.name, "its path in the folder"),
    "sha256": Column("SHA-256", lambda e: e.sha256 or None, "of the file"),
    "parent": Column("parent", lambda e: e.parent or None, "SHA-256 of what it was derived from"),
    "commit": Column("commit", lambda e: e.commit or None, "of the software that recorded it"),
    "bytes": Column("bytes", lambda e: float(e.size), "size of the file"),
}


def metadata_names(entries: Iterable[Entry]) -> list[str]:
    """The columns beyond ``COLUMNS``: the keys of the recordings' own metadata."""
    return sorted({key for entry in entries for key in entry.metadata} - set(COLUMNS))


def value_of(entry: Entry, name: str) -> Value:
    """The value of a column, or of a key of the recording's own metadata, for an entry; computed once an entry."""
    known = entry.__dict__.get("_values")
    if known is None:
        known = entry.__dict__["_values"] = {}
    if name not in known:
        column = COLUMNS.get(name)
        known[name] = column.value(entry) if column else _told(entry.metadata.get(name))
    value: Value = known[name]
    return value


def _told(text: str | None) -> Value:
    """Metadata are text; a number among them is one."""
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        return text


def differing(entries: list[Entry], names: Iterable[str]) -> list[str]:
    """Of these names those whose value is not the same for all entries."""
    found = []
    for name in names:
        values = (value_of(entry, name) for entry in entries)
        first = next(values, None)
        if any(value != first for value in values):
            found.append(name)
    return found


def ordered(entries: list[Entry], by: str) -> list[Entry]:
    """Sorted by a column; ``-name`` downwards. Numbers come before text, and absent values last, in either
    direction."""
    name = by.removeprefix("-")
    column = COLUMNS.get(name)
    key = (column and column.order) or (lambda entry: value_of(entry, name))
    keyed = [(key(entry), entry) for entry in entries]
    there = [pair for pair in keyed if pair[0] not in (None, ())]
    there.sort(key=lambda pair: (isinstance(pair[0], str | tuple), pair[0]), reverse=by.startswith("-"))
    return [entry for _, entry in there] + [entry for value, entry in keyed if value in (None, ())]
