"""Formats of tables, one file each: found by listing this folder, recognised by their first bytes."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from straw.rig.errors import RigError
from straw.rig.tables.table import Reading, Table


@dataclass(frozen=True)
class Format:
    """One format. ``recognises`` looks at a path and the file's bytes; ``read`` makes the table, or a RigError.

    The format of lowest ``rank`` that recognises a file reads it; the more specific a format, the lower its rank.
    """

    name: str
    about: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Path, bytes, Reading], Table]
    rank: int = 50


@cache
def formats() -> dict[str, Format]:
    """All formats by name, in the order in which they are tried."""
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    found: list[Format] = [importlib.import_module(f"{__name__}.{name}").FORMAT for name in names]
    return {one.name: one for one in sorted(found, key=lambda one: (one.rank, one.name))}


def format_of(path: Path, data: bytes, named: str | None = None) -> Format:
    """The format of a file; RigError where none reads it. ``named``: one of those known, or the file of a reader."""
    from straw.rig.tables.reader import reader_formats, reader_in  # imported late, as it uses the classes above

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
        f"{path.name}: is not a table that can be read; known: {', '.join(known)}. Save it as CSV, say --format, or "
        "give a reader of your own, --format R.py"
    )
