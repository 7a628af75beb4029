"""Reads and checks a user's law, from a file or an installed package."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import ModuleType
from typing import Any

from straw.model import plugged
from straw.model.compiled import compiled, exposed
from straw.model.errors import ModelError
from straw.model.law_contract import check_law, plain
from straw.model.term import Law


@dataclasses.dataclass(frozen=True)
class Origin:
    """Where a law comes from: its file and that file's SHA-256, or the package that brought it, and its version."""

    path: Path
    sha256: str
    package: str = ""

    def as_toml(self) -> str:
        """An entry of a straw file's ``laws``."""
        where = f'package = "{self.package}"' if self.package else f'file = "{self.path.as_posix()}"'
        return f'{{ {where}, sha256 = "{self.sha256}" }}'


def plugged_laws() -> list[tuple[Law, Origin]]:
    """Every law from outside, checked, ready for the model."""
    found = []
    for path in plugged.files():
        origin = Origin(path, plugged.sha256_of(path))
        found += [(ready(law), origin) for law in laws_in(path)]
    for entry, path in plugged.packages():
        try:
            given = entry.load()
        except Exception as error:
            raise ModelError(
                f"law {entry.value} of an installed package: {plugged.said(error)}; mend the package"
            ) from None
        package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module
        origin = Origin(path, plugged.sha256_of(path), package)
        laws = laws_of_module(given, package) if isinstance(given, ModuleType) else [given]
        for law in laws:
            check_law(law, package)
            found.append((ready(law), origin))
    return found


def laws_in(path: Path) -> list[Law]:
    """The laws a file gives as ``LAW`` or ``LAWS``, checked but not compiled; ModelError, one line."""
    module = plugged.module_of(path, "law")
    laws = laws_of_module(module, str(path))
    for law in laws:
        check_law(law, str(path))
    return laws


def laws_of_module(module: ModuleType, where: str) -> list[Law]:
    """What a module calls LAW or LAWS."""
    given = getattr(module, "LAWS", None) or ([module.LAW] if hasattr(module, "LAW") else [])
    laws = list(given) if isinstance(given, list | tuple) else []
    if not laws or not all(isinstance(law, Law) for law in laws):
        raise ModelError(f"{where}: gives no law; end it with LAW = straw.Law(name=..., law=..., source=..., ...)")
    return laws


def ready(law: Law) -> Law:
    """A law with its functions compiled, where they are plain Python."""
    how = exposed if law.kind == "body" else compiled
    made: dict[str, Any] = {
        name: how(function)
        for name in ("force", "energy")
        if (function := getattr(law, name)) is not None and plain(function) is function
    }
    return dataclasses.replace(law, **made)
