"""Chooses the format of a table: as named, or by what is in the file."""

from __future__ import annotations

from pathlib import Path

from straw.rig.errors import RigError
from straw.rig.tables.formats import Format, formats
from straw.rig.tables.reader import reader_formats, reader_in


def format_of(path: Path, data: bytes, named: str | None = None) -> Format:
    """The format of a file; RigError where none reads it. ``named``: one of those known, or the file of a reader."""
    if named is not None and named.endswith(".py"):
        return reader_in(Path(named))
    known = {**reader_formats(), **formats()}
    if named is not None:
        if named not in known:
            raise RigError(f"{path.name}: no format {named!r}; known: {', '.join(known)}, or a reader's file R.py")
        return known[named]
    for one in known.values():
        if one.recognises(path, data):
            return one
    raise RigError(
        f"{path.name}: is not a table that can be read; known: {', '.join(known)}. Save it as CSV, give --format, or "
        "give a reader of your own, --format R.py"
    )
