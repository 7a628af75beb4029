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

    The lowest ``rank`` that recognises a file reads it: the more a format is sure of itself, the lower.
    """

    name: str
    about: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Path, bytes, Reading], Table]
    rank: int = 50


@cache
def formats() -> dict[str, Format]:
    """All formats by name, in the order in which they are asked."""
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    found: list[Format] = [importlib.import_module(f"{__name__}.{name}").FORMAT for name in names]
    return {one.name: one for one in sorted(found, key=lambda one: (one.rank, one.name))}


def format_of(path: Path, data: bytes, named: str | None = None) -> Format:
    """The format of a file; RigError where nobody reads it."""
    if named is not None:
        if named not in formats():
            raise RigError(f"{path.name}: no format {named!r}; known: {', '.join(formats())}")
        return formats()[named]
    for one in formats().values():
        if one.recognises(path, data):
            return one
    raise RigError(
        f"{path.name}: is not a table that can be read; known: {', '.join(formats())}. Save it as CSV, or say --format"
    )
