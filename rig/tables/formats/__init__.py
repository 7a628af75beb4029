"""Formats of tables, one file each: found by listing this folder, recognised by their first bytes."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

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
