"""External parts other than laws (readers, figures of merit): the files and installed packages that provide them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from straw.model.errors import ModelError
from straw.model.plugged import module_of, said, sha256_of
from straw.rig.errors import RigError


@dataclass(frozen=True)
class Kind:
    """One kind of part. ``word``: a reader; ``names``: its name in a file, one or several; ``wanted``: its class.

    Files are named in the environment (``STRAW_READERS``), which child processes inherit; packages have an
    entry point of ``straw.readers``.
    """

    word: str
    names: tuple[str, str]
    wanted: type

    @property
    def variable(self) -> str:
        """Of the environment."""
        return f"STRAW_{self.word.upper()}S"

    @property
    def group(self) -> str:
        """Of entry points."""
        return f"straw.{self.word}s"


@dataclass(frozen=True)
class Part:
    """A part with where it comes from: "my_reader.py" and the file's SHA-256, or the package and its version."""

    what: Any
    where: str
    sha256: str = ""

    @property
    def origin(self) -> str:
        """As it goes on record."""
        return f"{Path(self.where).name} SHA-256 {self.sha256}" if self.sha256 else self.where


def add(kind: Kind, paths: Sequence[str | Path]) -> None:
    """Use the parts in these files from here on; RigError, one line, for a file that gives none."""
    known = _files(kind)
    for path in (Path(p).resolve() for p in paths):
        in_file(kind, path)
        if path not in known:
            known.append(path)
    os.environ[kind.variable] = os.pathsep.join(map(str, known))


def parts(kind: Kind) -> list[Part]:
    """Every external part of a kind: those of files in the order named, then those of packages by name."""
    return [*(part for path in _files(kind) for part in in_file(kind, path)), *_in_packages(kind)]


def in_file(kind: Kind, path: Path) -> list[Part]:
    """The parts a file gives; RigError, one line with its place."""
    try:
        sha256 = sha256_of(path)
        return _loaded(kind, path, sha256)
    except ModelError as error:
        text = str(error).replace("cannot read the law", f"cannot read the {kind.word}")
        text, unread, _ = text.partition("; check --")
        raise RigError(text + ("; check the name" if unread else "")) from None


@cache
def _loaded(kind: Kind, path: Path, sha256: str) -> list[Part]:
    return [Part(one, str(path), sha256) for one in given(kind, module_of(path, kind.word), str(path))]


def given(kind: Kind, module: object, where: str) -> list[Any]:
    """The parts of a kind in a module or an entry point's object; RigError where there are none, or of another
    class."""
    one, several = kind.names
    found = getattr(module, several, None)
    if found is None:
        found = [getattr(module, one)] if hasattr(module, one) else [] if isinstance(module, ModuleType) else [module]
    wanted = f"straw.{kind.wanted.__name__}"
    if not isinstance(found, list | tuple) or not found:
        raise RigError(f"{where}: gives no {kind.word}; end it with {one} = {wanted}(...)")
    for thing in found:
        if not isinstance(thing, kind.wanted):
            raise RigError(f"{where}: {one} = {' '.join(repr(thing).split())[:60]}; expected {wanted}(...)")
    return list(found)


def _files(kind: Kind) -> list[Path]:
    return [Path(text) for text in os.environ.get(kind.variable, "").split(os.pathsep) if text]


@cache
def _in_packages(kind: Kind) -> tuple[Part, ...]:
    from importlib import metadata  # imported here, as it takes as long as the rest of `straw --help`

    out = []
    for entry in sorted(metadata.entry_points(group=kind.group), key=lambda e: e.name):
        package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module
        try:
            module = entry.load()
        except Exception as error:
            raise RigError(
                f"{kind.word} {entry.value} of package {package}: {said(error)}; repair or remove the package"
            ) from None
        out += [Part(one, package) for one in given(kind, module, f"package {package}: {entry.value}")]
    return tuple(out)
