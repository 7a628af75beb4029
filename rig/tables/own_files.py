"""Reads straw's own table, and writes it whole or not at all: CSV with a side file, Parquet with the side inside."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.schema import TOPICS
from straw.rig.tables.formats._text import decode, head
from straw.rig.tables.formats.parquet import arrow, load
from straw.rig.tables.own import Rows, Side
from straw.rig.tables.own_codec import FIRST, PAYLOAD, Row

SIDE = ".json"
_KINDS: dict[str, type] = {kind.__name__: kind for kind in (float, int, bool, str, bytes)}
_PROTOBUF = {"double": float, "int32": int, "int64": int, "bool": bool, "string": str, "bytes": bytes}


def side_of(path: Path) -> Path:
    """Where the side file of a CSV lies."""
    return path.with_name(path.name + SIDE)


def is_own(path: Path, data: bytes) -> bool:
    """Whether a file is a table that straw export wrote."""
    if data.startswith(b"PAR1"):
        return b"log_time_ns" in data and b"straw_table" in data
    lines = head(data, 1)
    return bool(lines) and lines[0].split(",")[:4] == list(FIRST)


def write_csv(rows: Rows, path: Path) -> None:
    """Text that a spreadsheet opens: floats with all digits, bytes and line ends as escapes, empty for absent."""
    buffer = io.StringIO()
    names = list(rows.kinds)
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    for row in rows.rows:
        writer.writerow([_cell(row.get(name)) for name in names])
    _write({path: buffer.getvalue().encode(), side_of(path): rows.side.to_json().encode()})


def write_parquet(rows: Rows, path: Path) -> None:
    """One Parquet file, the side in its key-value metadata."""
    pa, parquet = arrow(path.name)
    types = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string(), bytes: pa.binary()}
    columns = {
        name: pa.array([row.get(name) for row in rows.rows], type=types[kind]) for name, kind in rows.kinds.items()
    }
    table = pa.table(columns).replace_schema_metadata({"straw_table": rows.side.to_json()})
    buffer = io.BytesIO()
    parquet.write_table(table, buffer, compression="zstd")
    _write({path: buffer.getvalue()})


def read_own(path: Path, data: bytes) -> tuple[list[Row], Side | None]:
    """Rows of such a table and its side, None where that is lost; RigError, with place, for a wrong cell."""
    if data.startswith(b"PAR1"):
        table = load(path, data)
        told = (table.schema.metadata or {}).get(b"straw_table")
        side = Side.from_json(told.decode(), path.name) if told else None
        return [_checked({k: v for k, v in row.items() if v is not None}, path, n) for n, row in
                enumerate(table.to_pylist(), 1)], side  # fmt: skip
    beside = side_of(path)
    side = Side.from_json(beside.read_text(encoding="utf-8"), beside.name) if beside.is_file() else None
    kinds = {name: _KINDS.get(kind, str) for name, kind in side.kinds.items()} if side else _contract_kinds()
    reader = csv.reader(io.StringIO(decode(data, path.name), newline=""))
    names = next(reader)
    unknown = [name for name in names if name not in kinds]
    if unknown:
        raise RigError(f"{path.name}: column {unknown[0]!r} was not written by straw export; remove it")
    rows = []
    for n, cells in enumerate(reader, 1):
        if not cells:
            continue
        if len(cells) != len(names):
            raise RigError(f"{path.name}: row {n} has {len(cells)} cells, the heading {len(names)}; repair or cut it")
        row: Row = {}
        for name, cell in zip(names, cells, strict=True):
            if cell != "":
                try:
                    row[name] = _value(cell, kinds[name])
                except ValueError:
                    raise RigError(
                        f"{path.name}: row {n}: {name} = {cell[:40]!r} is not {_WORDS[kinds[name]]}"
                    ) from None
        rows.append(_checked(row, path, n))
    return rows, side


_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text", bytes: "escaped bytes"}


def _contract_kinds() -> dict[str, type]:
    kinds: dict[str, type] = {"time_s": float, "topic": str, "time_ns": int, "log_time_ns": int, PAYLOAD: bytes}
    for schema in TOPICS.values():
        kinds |= {name: _PROTOBUF[kind] for name, kind, _ in schema.fields}
    return kinds


def _checked(row: Row, path: Path, n: int) -> Row:
    for name in ("topic", "time_ns"):
        if name not in row:
            raise RigError(f"{path.name}: row {n} has no {name}; repair or cut it")
    if not 0 < row["time_ns"] < 2**63:
        raise RigError(f"{path.name}: row {n}: time_ns = {row['time_ns']} is not a time since 1970")
    row.setdefault("log_time_ns", row["time_ns"])
    return row


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, bytes):
        return value.decode("latin-1").encode("unicode_escape").decode("ascii")
    if isinstance(value, str):
        return value.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r").replace("\0", "\\0")
    return repr(value)


def _value(cell: str, kind: type) -> Any:
    if kind is bool:
        if cell.casefold() not in ("true", "false", "1", "0"):
            raise ValueError
        return cell.casefold() in ("true", "1")
    if kind is bytes:
        try:
            return cell.encode("ascii").decode("unicode_escape").encode("latin-1")
        except UnicodeError:
            raise ValueError from None
    if kind is str:
        letters = {"n": "\n", "r": "\r", "0": "\0", "\\": "\\"}
        out, rest = [], iter(cell)
        for letter in rest:
            out.append(letters.get(after := next(rest, ""), "\\" + after) if letter == "\\" else letter)
        return "".join(out)
    return kind(cell)


def _write(files: dict[Path, bytes]) -> None:
    """All of them or none; nothing is overwritten."""
    for path in files:
        if path.exists():
            raise RigError(f"{path}: exists and is not overwritten; choose another name or move it away")
    parts = {path: path.with_name(path.name + ".part") for path in files}
    try:
        for path, data in files.items():
            with parts[path].open("wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
        for path, part in parts.items():
            part.rename(path)
    except OSError as error:
        for part in parts.values():
            part.unlink(missing_ok=True)
        raise RigError(
            f"{next(iter(files))}: cannot be written: {error.strerror or error}; choose another place"
        ) from None
