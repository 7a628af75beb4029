"""From the flags of straw import, over a mapping file, to the mapping that straw.rig.tables follows."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from straw.replay.about_run import TAKEN
from straw.replay.errors import ReplayError
from straw.replay.tables.options import COLUMNS
from straw.rig.tables import Mapping, Reading, Table, TableMap, load_mapping, read_table
from straw.rig.tables.formats._text import SEPARATORS
from straw.rig.tables.mapping import LEAST_LIKELIHOOD, checked_back, split_table, split_unit

_MINE = ("zero_time_ns", "imported_from", "imported_sha256", "imported_by", "import_notes")


def told(args: argparse.Namespace) -> tuple[list[Table], Mapping]:
    """The tables as read, and the mapping by flags and mapping file; an error names the flag."""
    mapping = load_mapping(args.map) if args.map else Mapping()
    maps = [_entry(path, args.tables, mapping) for path in args.tables]
    named = {one.file for one in mapping.tables if one.file} - {name for p in args.tables for name in (str(p), p.name)}
    if named:
        raise ReplayError(f"{args.map}: table {sorted(named)[0]!r} is not among the tables given; name it, too")
    maps = [replace(one, reading=_reading(args, one.reading)) for one in maps]
    tables = [read_table(path, one.reading) for path, one in zip(args.tables, maps, strict=True)]
    maps = [_flags(args, table, tables, one) for table, one in zip(tables, maps, strict=True)]
    for role in COLUMNS:
        for text in getattr(args, f"as_{role}"):
            maps = place(role, text, tables, maps)
    metadata = {**mapping.metadata, **metadata_of(args)}
    whole = Mapping(
        tuple(maps),
        args.start or mapping.start,
        args.time_zone or mapping.time_zone,
        metadata,
        args.as_stated or mapping.as_stated,
    )
    return tables, whole


def _entry(path: Path, paths: Sequence[Path], mapping: Mapping) -> TableMap:
    """The mapping file's entry of a table: by its name, or because both are single."""
    for one in mapping.tables:
        if one.file in (str(path), path.name) or (not one.file and len(paths) == len(mapping.tables) == 1):
            return replace(one, file=str(path))
    return TableMap(str(path))


def _reading(args: argparse.Namespace, said: Reading) -> Reading:
    separator = args.separator or said.separator
    separator = SEPARATORS.get(separator, separator) if separator else None
    if separator is not None and len(separator) != 1:
        raise ReplayError(f"--separator {separator!r}: expected one character, or {', '.join(SEPARATORS)}")
    return Reading(
        args.format or said.format,
        separator,
        args.decimal or said.decimal,
        args.thousands or said.thousands,
        args.encoding or said.encoding,
        args.skip or said.skip,
    )


def _flags(args: argparse.Namespace, table: Table, tables: list[Table], said: TableMap) -> TableMap:
    changes: dict[str, object] = {}
    for flag, name in (("rate", "rate_hz"), ("offset", "offset_s")):
        for text in getattr(args, flag):
            which, value = split_table(text, tables)
            if which is None and len(tables) > 1 and flag == "offset":
                raise ReplayError(f"--offset {text}: name the table, as {tables[-1].name}:{text}")
            if which in (None, table):
                if (
                    flag == "rate"
                    and which is None
                    and len(tables) > 1
                    and table.roles
                    and "time" in table.roles.values()
                ):
                    continue  # a table that has a time of its own
                changes[name] = _number(value, f"--{flag}")
    if args.back:
        which, value = split_table(args.back, tables)
        if which in (None, table):
            changes["back"] = checked_back(value)
    if args.points and (len(tables) == 1 or set(args.points) <= set(table.points)):
        changes["points"] = tuple(args.points)
        changes["points_unit"] = args.points_unit or ""
    if args.origin_px:
        pair = args.origin_px.split(",")
        if len(pair) != 2:
            raise ReplayError(f"--origin-px {args.origin_px}: expected U,V, as 960,1010")
        changes["origin_px"] = (_number(pair[0], "--origin-px"), _number(pair[1], "--origin-px"))
    for flag in ("mm_per_px", "date_order"):
        if getattr(args, flag) is not None:
            changes[flag] = getattr(args, flag)
    if args.least_likelihood is not None or said.least_likelihood != LEAST_LIKELIHOOD:
        changes["least_likelihood"] = said.least_likelihood if args.least_likelihood is None else args.least_likelihood
    if args.tip_offset is not None:
        changes["tip_offset_mm"] = args.tip_offset
    for name in ("rate_hz", "mm_per_px"):
        given = changes.get(name)
        if isinstance(given, float) and not given > 0:
            raise ReplayError(f"--{name.removesuffix('_hz').replace('_', '-')} {given:g}: expected a number above 0")
    return replace(said, **changes)  # type: ignore[arg-type]


def place(role: str, text: str, tables: list[Table], maps: list[TableMap]) -> list[TableMap]:
    """The mappings with one more column in a role: in the table named, or in the one that has such a column."""
    which, name = split_table(text, tables)
    out = list(maps)
    if name.strip().casefold() == "none":
        return [
            replace(m, uses={**m.uses, role: ()}) if which in (None, t) else m
            for t, m in zip(tables, maps, strict=True)
        ]
    uses = [split_unit(name, table) if which in (None, table) else None for table in tables]
    found = [k for k, use in enumerate(uses) if use]
    if not found:
        which = which or tables[0]
        more = "" if len(tables) == 1 else f" (nor has any other of the {len(tables)} tables)"
        raise ReplayError(f"{which.name}: no column {name!r}{more}; its columns are {which.names()}")
    if len(found) > 1 and role != "time":
        names = " and ".join(tables[k].name for k in found[:2])
        raise ReplayError(
            f"--{role.replace('_', '-')} {name!r}: both {names} have it; name one, as {tables[found[0]].name}:{name}"
        )
    for k in found:
        use = uses[k]
        assert use is not None
        before = () if role not in ("pressure", "command") else tuple(u for u in out[k].uses.get(role, ()) if u.column)
        flagged = sum(1 for u in before)
        out[k] = replace(out[k], uses={**out[k].uses, role: (*before, replace(use, channel=flagged + 1))})
    return out


def metadata_of(args: argparse.Namespace) -> dict[str, str]:
    """The run's metadata by the flags; ReplayError for invalid ones."""
    found: dict[str, str] = {}
    for text in args.meta:
        key, equals, value = text.partition("=")
        if not equals or not key.replace("-", "_").isidentifier() or key in (*TAKEN, *_MINE):
            raise ReplayError(
                f"--meta {text}: expected KEY=VALUE, as fluid=water; use the flag of its own for other keys"
            )
        found[key] = value
    if args.deployed is not None:
        cells = "" if args.deployed.casefold() in ("none", "") else args.deployed
        if any(not cell.strip().isdecimal() for cell in cells.split(",") if cells):
            raise ReplayError(f"--deployed {args.deployed}: expected cells, as 1,4, or none")
        found["initial_deployed"] = ",".join(cell.strip() for cell in cells.split(","))
    for key in ("specimen", "cycle", "cells", "run_id"):
        if getattr(args, key) is not None:
            found[key] = str(getattr(args, key))
    return found


def _number(text: str, flag: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ReplayError(f"{flag} {text}: expected a number") from None
    if not abs(value) < float("inf"):
        raise ReplayError(f"{flag} {text}: expected a finite number")
    return value
