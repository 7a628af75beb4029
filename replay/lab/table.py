"""Table: the library's entries for one view of the catalogue's page: filtered, sorted, grouped, in windows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

from straw.replay.lab.library import Library
from straw.rig.catalogue import Entry
from straw.rig.columns import COLUMNS, Value, differing, ordered, value_of
from straw.rig.errors import RigError
from straw.rig.filter import compiled

Selected: TypeAlias = tuple[list[Entry], list[list[Any]]]
SHOWN = ("run", "start", "specimen", "protocol", "cycle", "duration", "status", "tag", "note")
GROUPS = ("specimen", "protocol", "cycle", "day", "status", "deployed")
#: Rows of one answer, at the most.
WINDOW = 300
#: By default a table shows recorded runs, not derived files.
RECORDED = ("run", "part", "running", "unreadable")


def view(library: Library, asked: Mapping[str, str]) -> dict[str, Any]:
    """Rows ``offset`` to ``offset + limit`` of a view; RigError where the view is not valid.

    ``where``: a filter; ``sort``: a column, -column downwards; ``group``: a column; ``columns``: names with commas;
    ``differs``: only columns in which the rows differ; ``all``: tracks, predictions and archived recordings, too.
    """
    names = [name for name in asked.get("columns", "").split(",") if name] or list(SHOWN)
    sort, group = asked.get("sort", "") or "-start", asked.get("group", "")
    for name in (*names, sort.removeprefix("-"), *([group] if group else [])):
        if name not in COLUMNS and name not in library.metadata:
            raise RigError(f"no such column: {name}; known: {', '.join(COLUMNS)}, {', '.join(library.metadata)}")
    key = (asked.get("where", ""), sort, group, asked.get("all") == "1")
    found, groups = library.remembered(key, lambda: selected(library, *key))
    if asked.get("differs") == "1":
        candidates = [*names, *(key for key in library.metadata if key not in names)]
        names = [name for name in differing(found, candidates) if name not in UNTELLING]
    offset, limit = _whole(asked, "offset", 0), min(_whole(asked, "limit", 100), WINDOW)
    tips = library.remembered("tips", lambda: _tips(library.entries))
    return {
        "version": library.version,
        "total": len(found),
        "of": len(library),
        "reading": library.reading,
        "problem": library.problem,
        "columns": [[name, COLUMNS[name].title if name in COLUMNS else name] for name in names],
        "groups": groups,
        "offset": offset,
        "rows": [row(e, names, group, tips) for e in found[offset : offset + limit]],
    }


def selected(library: Library, where: str, sort: str, group: str, everything: bool) -> Selected:
    """Recordings that pass a filter, sorted and grouped, and the groups as [name, how many]."""
    test = compiled(where, library.metadata)
    everything = everything or "kind" in where
    archived = everything or "archived" in where
    found = [
        e
        for e in library.entries
        if (everything or e.kind in RECORDED) and (archived or "archive" not in e.marks) and test(e)
    ]
    found = ordered(found, sort)
    return grouped(found, group) if group else (found, [])


#: Metadata that differ between any two runs and are left out.
UNTELLING = {"run_id", "zero_time_ns", "cycles", "port", "missed_readings", "parent_sha256", "exit_reason"}


def row(entry: Entry, names: list[str], group: str, tips: Mapping[str, Entry]) -> dict[str, Any]:
    """One recording for the page; the tip of a run is its track's."""
    preview = dict(entry.preview)
    if "x" not in preview and entry.sha256 in tips:
        preview |= {key: tips[entry.sha256].preview[key] for key in ("x", "z")}
    return {
        "name": entry.name,
        "kind": entry.kind,
        "marks": entry.marks,
        "problem": entry.problem,
        "group": _text(value_of(entry, group)) if group else None,
        "cells": [_json(value_of(entry, name)) for name in names],
        "preview": preview,
    }


def grouped(entries: list[Entry], by: str) -> Selected:
    """Entries with equal values of a column together, in the order they came; the groups as [name, how many]."""
    together: dict[Value, list[Entry]] = {}
    for entry in entries:
        together.setdefault(value_of(entry, by), []).append(entry)
    names = sorted(together, key=lambda v: (v is None, isinstance(v, str | tuple), v if v is not None else 0))
    return [e for name in names for e in together[name]], [[_text(name), len(together[name])] for name in names]


def _tips(entries: list[Entry]) -> dict[str, Entry]:
    """Derived recordings that show a tip, by what they were derived from; a track before a prediction."""
    derived = [e for e in entries if e.parent and "x" in e.preview]
    return {e.parent: e for e in sorted(derived, key=lambda e: e.kind == "track")}


def _json(value: Value) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _text(value: Value) -> str:
    if value is None or value == ():
        return "-"
    if isinstance(value, float):
        return f"{value:g}"
    return ", ".join(value) if isinstance(value, tuple) else value


def _whole(asked: Mapping[str, str], name: str, otherwise: int) -> int:
    text = asked.get(name, "")
    if not text:
        return otherwise
    if not text.isdecimal():
        raise RigError(f"{name} = {text!r} is not a whole number")
    return int(text)
